# SPDX-License-Identifier: MIT
# Thin front of CMake and the tools; `make help` lists the targets.
SHELL := /bin/bash
.DEFAULT_GOAL := help
JOBS ?= 2
# A program built with coverage or sanitizers lives in its own folder; everything a user runs is in build/.
PYTHON := .venv/bin/python

.PHONY: help setup build build-tests demo check test test-long test-slow test-programs test-realtime test-wheel test-controller test-distribution test-embedded test-languages test-package package docs docs-pictures score bench bench-quick bench-check bench-peers \
	fuzz lint format sanitize sanitize-all coverage sbom audit clean

help: ## this list
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## /  make \1\t/' | expand -t 22

setup: ## install what is missing (Debian packages, .venv); silent when nothing is
	@tools/setup.sh build

build: setup ## build/okid, build/libokid.so, build/libokid.a, .venv with `import okid`
	@[ -e build/okid ] || echo "build: compiling, some minutes the first time"
	@cmake --preset release -DOKID_BUILD_TESTS=OFF --log-level=WARNING >/dev/null
	@cmake --build build -j$(JOBS) -- --quiet

demo: build ## play a simulated shaker test, frame by frame, through the front end, identify it while it plays, write a report
	@tools/demo.sh

check: ## while you work: build and unit tests; T=refine: the unit and Python tests of that idea; LF=1: what failed last
	@tools/setup.sh test
	@tests/check "$(T)" $(if $(LF),--lf)

build-tests:
	@tools/setup.sh test
	@[ -e build/okid ] || echo "build: compiling, some minutes the first time"
	@cmake --preset release -DOKID_BUILD_TESTS=ON --log-level=WARNING >/dev/null
	@cmake --build build -j$(JOBS) -- --quiet

test: build-tests ## what proves the product in minutes, real vcan included; judges okid, never the machine
	@tests/run

test-long: build-tests ## the rest of it: tests that take over a second each
	@tests/run long

test-slow: ## both with more seeds, more frames, longer loads
	@OKID_SLOW=1 $(MAKE) --no-print-directory test
	@OKID_SLOW=1 $(MAKE) --no-print-directory test-long

test-programs: build-tests ## with large programs of others: Chromium, InfluxDB, Mosquitto, shells, an emulated CAN controller
	@tools/setup.sh programs
	@tests/run programs

test-realtime: build-tests ## what judges the clock on the wall: latency, load, priority; on a machine that does nothing else
	@tests/run realtime

test-wheel: ## the Python package as a stranger installs it: source distribution, wheel, fresh environment
	@tools/setup.sh test
	@tests/wheel/run

test-controller: ## okid on CAN controllers and a USB adapter, emulated, with the drivers of the stock kernel
	@tools/setup.sh programs
	@cmake --preset release -DOKID_BUILD_TESTS=ON --log-level=WARNING >/dev/null
	@cmake --build build -j$(JOBS) --target okid_program vcan_flood -- --quiet
	@tests/controller/run

test-distribution: ## build and unit tests in clean Debian 13 and Debian testing (root)
	@tools/setup.sh package
	@tests/distribution/run

test-embedded: ## firmware on Cortex-M in QEMU, the library on Arm boards, the installed package
	@tools/setup.sh embedded
	@tests/embedded/run

test-languages: build ## bindings of tools/bindings.py: Rust by cargo, okid_identify in GNU Octave
	@tools/setup.sh languages
	@$(PYTHON) -m pytest -q -p no:cacheprovider -c tools/pyproject.toml --rootdir . tests/languages

score: build ## the default identification on measured records ($OKID_DATA), beside release 0.1's figures
	@$(PYTHON) tools/score.py build/okid

bench: build ## speed of the kernels and of whole identifications as ratios within one run
	@tools/setup.sh bench || echo "bench: going on without SLICOT"
	@tools/setup.sh test
	@OPENBLAS_NUM_THREADS=1 build/okid bench --only kernels --save build/bench.json
	@cmake --build build --target bench_slicot -- --quiet && OPENBLAS_NUM_THREADS=1 build/tests/bench_slicot build/bench.json
	@$(PYTHON) tests/bench/python_call.py build/bench.json
	@$(PYTHON) tests/bench/identify_beside.py build/bench.json
	@$(PYTHON) tests/bench/campaign.py 1000 5 build/bench.json
	@OKID_PROGRAM=build/okid $(PYTHON) tests/bench/files.py build/bench.json
	@$(PYTHON) tests/bench/whole_answers.py build/bench.json
	@cmake --build build --target bench_latency -- --quiet && OPENBLAS_NUM_THREADS=1 build/tests/bench_latency build/bench.json

bench-quick: build ## what takes two minutes of it: sizes are judged, speeds told
	@tools/setup.sh bench
	@tools/setup.sh test
	@OPENBLAS_NUM_THREADS=1 build/okid bench --only kernels --save build/bench-quick.json >/dev/null
	@for part in python_call identify_beside files whole_answers; do \
	  OKID_PROGRAM=build/okid $(PYTHON) tests/bench/$$part.py build/bench-quick.json || exit 1; done
	@$(PYTHON) tools/bench_check.py build/bench-quick.json --sizes

bench-check: bench ## exit 1 when a ratio falls short of what the kernel promises
	@$(PYTHON) tools/bench_check.py build/bench.json

bench-peers: build ## other programs on the same data, into build/peers.json
	@tools/setup.sh bench || echo "bench-peers: going on without SLICOT"
	@tests/bench/peers/run

sanitize: ## unit tests under AddressSanitizer and UndefinedBehaviourSanitizer, on one linear-algebra backend
	@tools/setup.sh test
	@cmake --preset sanitize --log-level=WARNING >/dev/null
	@cmake --build build-sanitize -j$(JOBS) -- --quiet
	@ctest --test-dir build-sanitize --output-on-failure -j$(JOBS) --no-tests=error

sanitize-all: ## every tier under AddressSanitizer, threads under ThreadSanitizer
	@tools/setup.sh test
	@tests/sanitize/run

coverage: ## lines of lib and drivers that their tests run, as a table; below 95 % is an error
	@tools/setup.sh dev
	@tools/coverage.sh

sbom: build ## bill of materials: build/sbom.cdx.json and docs/reference/dependencies.md
	@tools/setup.sh docs
	@$(PYTHON) tools/sbom.py

audit: sbom ## known holes in what okid stands on: PyPI's advisories, updates that wait in Debian's archive
	@.venv/bin/python tools/audit.py

fuzz: build ## fuzzers of every decoder and file reader, SECONDS=60 for all of them together
	@tools/setup.sh fuzz
	@tests/fuzz/run $(or $(SECONDS),60)

package: ## Debian packages in build/package/packages
	@tools/setup.sh package
	@packaging/build

test-package: ## packages and wheel in clean systems: installed, used, purged (root)
	@tools/setup.sh package
	@tests/package/run

docs: ## the documentation as web pages in build/docs; every warning is an error
	@tools/setup.sh docs
	@tools/docs.sh

docs-pictures: build ## every picture of docs/images, from real runs (some minutes; needs Chromium)
	@tools/setup.sh programs
	@tools/setup.sh docs
	@PYTHONPATH=tools $(PYTHON) -m docs_pictures

lint: ## format, clang-tidy, cppcheck, warnings of two compilers, ruff, mypy
	@tools/setup.sh dev
	@tools/lint.sh

format: ## rewrite C, C++ and Python in the house style
	@tools/setup.sh dev
	@git ls-files '*.c' '*.h' '*.cpp' '*.hpp' | xargs .venv/bin/clang-format -i
	@.venv/bin/ruff format --config tools/pyproject.toml -q tools tests

clean: ## remove build folders (not .venv)
	@rm -rf build build-dev build-sanitize build-coverage build-float build-embedded build-fuzz build-thread
