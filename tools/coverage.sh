#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Lines of lib and drivers that their Unity programs run: a table of the files, exit 1 below the threshold for all of them
# together. What only a device or a bus can show is tested elsewhere (tests/gpio, tests/vcan) and not counted here.
# usage: tools/coverage.sh   OKID_COVERAGE_BUILD names another build folder; coverage.txt, .json, .html and the logs stay there.
set -euo pipefail
cd "$(dirname "$0")/.."
[ $# -eq 0 ] || { echo "coverage: found the argument '$1', expected none" >&2; exit 2; }
[ -x .venv/bin/gcovr ] || { echo "coverage: no gcovr in .venv; run tools/setup.sh dev" >&2; exit 4; }
threshold=95
build=${OKID_COVERAGE_BUILD:-$PWD/build-coverage}
jobs=${JOBS:-2}
failed=0

cmake --preset coverage -B "$build" --log-level=WARNING >/dev/null
cmake --build "$build" -j"$jobs" --target okid_core_tests -- --quiet
find "$build" -name '*.gcda' -delete
OPENBLAS_NUM_THREADS=1 ctest --test-dir "$build" -L core -j"$jobs" --output-on-failure --no-tests=error >"$build/ctest.log" 2>&1 || failed=1
grep 'tests passed' "$build/ctest.log" || true
[ $failed -eq 0 ] || { echo "coverage: a test failed:" >&2; tail -n 20 "$build/ctest.log" >&2; }

# Kernels run their loops more than 2^32 times: no count is suspicious.
.venv/bin/gcovr --root . --filter lib/ --filter drivers/ --merge-mode-functions=merge-use-line-0 --gcov-suspicious-hits-threshold=0 \
  --txt "$build/coverage.txt" --json-summary "$build/coverage.json" --html-details "$build/coverage.html" "$build" 2>"$build/gcovr.log" ||
  { tail -n 5 "$build/gcovr.log" >&2; exit 1; }
cat "$build/coverage.txt"
.venv/bin/python - "$build/coverage.json" $threshold <<'PY' || failed=1
import json
import sys

summary, threshold = json.load(open(sys.argv[1], encoding="utf-8")), float(sys.argv[2])
for one in sorted(summary["files"], key=lambda one: one["line_percent"]):
    if one["line_percent"] < threshold:
        print(f"below {threshold:g} %: {one['filename']}, {one['line_percent']:.1f} % of {one['line_total']} lines")
covered, total = summary["line_covered"], summary["line_total"]
print(f"coverage: {covered} of {total} lines of lib and drivers, {100 * covered / total:.2f} %, expected at least {threshold:g} %")
sys.exit(100 * covered < threshold * total)
PY
exit $failed
