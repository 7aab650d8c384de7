#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Lines of lib and drivers that their Unity programs run: a table of the files, exit 1 below the threshold for all of them
# together. What only a device or a bus can show is tested elsewhere (tests/gpio, tests/vcan) and not counted here.
# --all: lines of the host program (C++) and of the Python package too, run by all Unity programs and the Python tier.
# usage: tools/coverage.sh [--all]   OKID_COVERAGE_BUILD names another build folder; coverage*.txt, .json, .html and the logs stay there.
set -euo pipefail
cd "$(dirname "$0")/.."
whole=
[ "${1:-}" != --all ] || { whole=1; shift; }
[ $# -eq 0 ] || { echo "coverage: found the argument '$1', expected --all or none" >&2; exit 2; }
[ -x .venv/bin/gcovr ] || { echo "coverage: no gcovr in .venv; run tools/setup.sh dev" >&2; exit 4; }
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
measured() { # name, build folder, least percent, folders
  local name=$1 from=$2 least=$3 filters=()
  for folder in "${@:4}"; do filters+=(--filter "$folder/"); done
  .venv/bin/gcovr --root . "${filters[@]}" --merge-mode-functions=merge-use-line-0 --gcov-suspicious-hits-threshold=0 --txt "$from/$name.txt" \
    --json-summary "$from/$name.json" --html-details "$from/$name.html" "$from" 2>"$from/gcovr.log" || { tail -n 5 "$from/gcovr.log" >&2; exit 1; }
  cat "$from/$name.txt"
  .venv/bin/python - "$from/$name.json" "$least" "${@:4}" <<'PY' || failed=1
import json
import sys

summary, least, folders = json.load(open(sys.argv[1], encoding="utf-8")), float(sys.argv[2]), " and ".join(sys.argv[3:])
for one in sorted(summary["files"], key=lambda one: one["line_percent"]):
    if one["line_percent"] < least:
        print(f"below {least:g} %: {one['filename']}, {one['line_percent']:.1f} % of {one['line_total']} lines")
covered, total = summary["line_covered"], summary["line_total"]
print(f"coverage: {covered} of {total} lines of {folders}, {100 * covered / total:.2f} %, expected at least {least:g} %")
sys.exit(100 * covered < least * total)
PY
}
measured coverage "$build" 95 lib drivers
[ -n "$whole" ] || exit $failed

# One build more: the host program counts its lines, in the tests of the Python tier too. Those judge nothing here: they may
# look at memory and time.
host=$build-all
cmake --preset coverage -B "$host" -DOKID_COVERAGE_HOST=ON -DOKID_ALL_BACKENDS=OFF --log-level=WARNING >/dev/null
cmake --build "$host" -j"$jobs" -- --quiet
find "$host" -name '*.gcda' -delete
rm -rf "$host/python" && mkdir "$host/python"
cat >"$host/python.ini" <<END
[run]
source = $PWD/tools/okid
data_file = $host/python/data
parallel = true
patch = subprocess
concurrency = thread,multiprocessing
END
export OPENBLAS_NUM_THREADS=1 OKID_PROGRAM=$host/okid OKID_LIBRARY=$host/libokid.so OKID_HOST_LIBRARY=$host/libokid_host.so
ctest --test-dir "$host" -j"$jobs" >"$host/ctest.log" 2>&1 || true
.venv/bin/python -m coverage run --rcfile "$host/python.ini" -m pytest -q -p no:cacheprovider -c tools/pyproject.toml --rootdir . -n "$jobs" \
  --dist loadfile ${OKID_COVERAGE_TESTS:-tests/{abi,campaign,capture,docs,examples,formats,hostile,io,live,notebooks,parity,property,replay,report}} \
  >"$host/python.log" 2>&1 || true
tail -n 1 "$host/python.log"
measured host "$host" 90 firmware_host
.venv/bin/python -m coverage combine -q --rcfile "$host/python.ini"
.venv/bin/python -m coverage report --rcfile "$host/python.ini" --fail-under 90 | tee "$host/python.txt" || failed=1
exit $failed
