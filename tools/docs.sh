#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# The documentation as web pages: build/docs/site (mkdocs: pages, Python package, and in c/ the C headers by Doxygen).
# Every warning is an error. Needs doxygen, and the extra "docs" of tools/pyproject.toml in .venv.
set -euo pipefail
cd "$(dirname "$0")/.."
command -v doxygen >/dev/null || { echo "docs: doxygen is missing: apt-get install doxygen" >&2; exit 4; }
[ -x .venv/bin/mkdocs ] || { echo "docs: mkdocs is missing: .venv/bin/pip install './tools[docs]'" >&2; exit 4; }
mkdir -p build/docs
doxygen Doxyfile || { echo "docs: Doxygen found the above in the headers" >&2; exit 1; }
# Not --quiet: with it mkdocs counts no warnings.
log=$(mktemp)
NO_MKDOCS_2_WARNING=1 .venv/bin/mkdocs build --strict >"$log" 2>&1 || { grep -v ^INFO "$log" >&2; rm -f "$log"; exit 1; }
rm -f "$log"
echo "docs: build/docs/site/index.html"
