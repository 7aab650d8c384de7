#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Format, static analysis and the rules of the house that a grep can check. Exits non-zero on the first kind of trouble.
# OKID_LINT_BASE=COMMIT: clang-tidy, most of the time, reads only what changed since then; .ci/nightly reads everything.
set -uo pipefail
cd "$(dirname "$0")/.."
bad=0
bin=.venv/bin
c_files=$(git ls-files '*.c' '*.h' '*.cpp' '*.hpp')

$bin/clang-format --dry-run -Werror $c_files || { echo "lint: run make format"; bad=1; }
$bin/ruff check --config tools/pyproject.toml tools tests || bad=1
$bin/ruff format --check --config tools/pyproject.toml -q tools tests || { echo "lint: run make format"; bad=1; }
(cd tools && ../$bin/mypy --config-file pyproject.toml) || bad=1

# Its own compile commands: clang cannot read the precompiled headers of gcc.
cmake -S . -B build/tidy -G Ninja -DOKID_BUILD_TESTS=OFF -DOKID_UNITY=OFF -DCMAKE_DISABLE_PRECOMPILE_HEADERS=ON --log-level=WARNING >/dev/null || exit 1
tidy() { xargs -r -P "${JOBS:-2}" -n 4 $bin/clang-tidy --quiet -p build/tidy "$@" 2>/dev/null || { echo "lint: clang-tidy found something"; bad=1; }; }
analyser='clang-analyzer-*,-clang-analyzer-optin.performance.Padding,-clang-analyzer-unix.StdCLibraryFunctions'
analyser+=',-clang-analyzer-security.insecureAPI.DeprecatedOrUnsafeBufferHandling'
built() { git ls-files "$@" | while read -r file; do grep -q "/$file\"" build/tidy/compile_commands.json && echo "$file"; done; }
base=${OKID_LINT_BASE:-}
[ -z "$base" ] || git diff --quiet "$base" -- .clang-tidy tools/lint.sh || base= # other rules: everything
touched() { # of the files named on stdin those that changed since the base, or that include a header that did
  [ -n "$base" ] || { cat; return; }
  local file
  git diff --name-only "$base" -- '*.c' '*.cpp' '*.h' '*.hpp' >build/tidy/changed
  while read -r file; do
    git grep -lE "#include [<\"]([^\"]*/)?$(basename "$file")[>\"]" -- '*.c' '*.cpp'
  done < <(grep -E '\.(h|hpp)$' build/tidy/changed) >build/tidy/including
  grep -Fx -f build/tidy/changed -f build/tidy/including || true
}
tidy "--checks=$analyser" < <(built 'lib/src/*.c' 'drivers/src/*.c' | touched) # of the two libgpiod sources the one this machine has
tidy < <(git ls-files 'lib/src/*.cpp' 'firmware_host/*.cpp' | touched)

# A second reader of C and C++. What it may not say, and why:
checked=(--quiet --enable=warning,performance,portability --inline-suppr --error-exitcode=1 -D_GNU_SOURCE
  -Ilib/include -Ilib/src -Idrivers/include -Idrivers/src -Ifirmware_host
  --suppress=missingIncludeSystem                  # no need to read the headers of the system
  '--suppress=invalidPointerCast:lib/src/accumulate/*' # a block of numbers holds doubles or int64, each read as it was written
  '--suppress=legacyUninitvar:lib/src/*')          # takes `new (place) T{}` for a variable without a value; uninitvar stays on
if command -v cppcheck >/dev/null; then
  cppcheck "${checked[@]}" --language=c --std=c11 $(git ls-files 'lib/src/*.c' 'drivers/src/*.c') || bad=1
  cppcheck "${checked[@]}" --language=c++ --std=c++17 $(git ls-files 'lib/src/*.cpp' 'firmware_host/*.cpp') || bad=1
else
  echo "lint: no cppcheck; run tools/setup.sh dev"; bad=1
fi

# Warnings of library and drivers are errors: two compilers, both backends, both number types.
strict() { # folder, compilers of C and of C++, what to build, options
  cmake -S . -B "build/strict-$1" -G Ninja -DCMAKE_C_COMPILER="$2" -DCMAKE_CXX_COMPILER="$3" -DCMAKE_BUILD_TYPE=None -DOKID_WERROR=ON \
    -DOKID_OPTIMISE_LIB=-O0 -DOKID_BUILD_TESTS=OFF --log-level=WARNING "${@:5}" >/dev/null &&
    cmake --build "build/strict-$1" --target $4 -j"${JOBS:-2}" -- --quiet || { echo "lint: a warning of $2 ($1)"; bad=1; }
}
clang=$(command -v clang-14 || command -v clang) || { echo "lint: no clang; run tools/setup.sh dev"; bad=1; }
for compilers in "gcc g++" ${clang:+"$clang ${clang/clang/clang++}"}; do
  read -r c cxx <<<"$compilers"
  strict "$(basename "$c")" "$c" "$cxx" "okid_static okid_drivers"
  strict "$(basename "$c")-float" "$c" "$cxx" okid_static -DOKID_LIBRARY_ONLY=ON -DOKID_LINALG=eigen -DOKID_REAL=float -DOKID_INTEGER_KERNEL=ON
done

# The storeys: lib and drivers do not know each other.
grep -rnE '#include [<"](drv|nlohmann|CLI|toml)' lib && { echo "lint: lib includes what it must not know"; bad=1; }
grep -rnE '#include [<"]okid/' drivers && { echo "lint: drivers include lib"; bad=1; }
for file in $c_files $(git ls-files '*.py' '*.sh' '*.cmake' '*CMakeLists.txt'); do
  grep -q 'SPDX-License-Identifier: MIT' "$file" || { echo "lint: $file has no SPDX line"; bad=1; }
done
for file in $(git ls-files 'lib/*' 'drivers/*' 'firmware_host/*' 'tools/okid/*'); do
  [ "$(wc -l <"$file")" -le 500 ] || { echo "lint: $file is longer than 500 lines"; bad=1; }
done
exit $bad
