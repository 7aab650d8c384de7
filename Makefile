# SPDX-License-Identifier: MIT
# Thin front of CMake and the tools; `make help` lists the targets.
SHELL := /bin/bash
.DEFAULT_GOAL := help
JOBS ?= 2
# A program built with coverage or sanitizers lives in its own folder; everything a user runs is in build/.
PYTHON := .venv/bin/python

.PHONY: help setup build demo test test-slow test-embedded bench bench-check fuzz lint format sanitize clean

help: ## this list
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## /  make \1\t/' | expand -t 22

setup: ## install what is missing (Debian packages, .venv); silent when nothing is
	@tools/setup.sh build

build: setup ## build/okid, build/libokid.so, build/libokid.a, .venv with `import okid`
	@cmake --preset release -DOKID_BUILD_TESTS=OFF --log-level=WARNING >/dev/null
	@cmake --build build -j$(JOBS) -- --quiet

demo: build ## play a recorded shaker test through the front end, identify it while it plays, write a report
	@tools/demo.sh

test: ## everything that proves the product, real vcan included
	@tools/setup.sh test
	@cmake --preset release -DOKID_BUILD_TESTS=ON --log-level=WARNING >/dev/null
	@cmake --build build -j$(JOBS) -- --quiet
	@tests/run

test-slow: ## the long tiers: more seeds, more frames
	@tools/setup.sh test
	@cmake --preset release -DOKID_BUILD_TESTS=ON --log-level=WARNING >/dev/null
	@cmake --build build -j$(JOBS) -- --quiet
	@OKID_SLOW=1 tests/run

test-embedded: ## the library on other processors, cross-compiled and run in an emulator
	@tools/setup.sh embedded
	@tests/embedded/run

bench: build ## speed of the kernels and of whole identifications as ratios within one run
	@tools/setup.sh bench || echo "bench: going on without SLICOT"
	@tools/setup.sh test
	@OPENBLAS_NUM_THREADS=1 build/okid bench --save build/bench.json
	@PYTHONPATH=tests/property:tests/io OPENBLAS_NUM_THREADS=1 $(PYTHON) tests/bench/live_latency.py

bench-check: bench ## exit 1 when a ratio falls short of what the kernel promises
	@$(PYTHON) tools/bench_check.py build/bench.json

sanitize: ## unit tests under AddressSanitizer and UndefinedBehaviourSanitizer
	@tools/setup.sh test
	@cmake --preset sanitize --log-level=WARNING >/dev/null
	@cmake --build build-sanitize -j$(JOBS) -- --quiet
	@ctest --test-dir build-sanitize --output-on-failure -j$(JOBS) --no-tests=error

fuzz: ## fuzzers of every decoder and file reader, SECONDS=60 for all of them together
	@tools/setup.sh fuzz
	@tests/fuzz/run $(or $(SECONDS),60)

lint: ## format, clang-tidy, ruff, mypy
	@tools/setup.sh dev
	@tools/lint.sh

format: ## rewrite C, C++ and Python in the house style
	@tools/setup.sh dev
	@git ls-files '*.c' '*.h' '*.cpp' '*.hpp' | xargs .venv/bin/clang-format -i
	@.venv/bin/ruff format --config tools/pyproject.toml -q tools tests

clean: ## remove build folders (not .venv)
	@rm -rf build build-sanitize build-coverage build-float build-aarch64 build-fuzz
