#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Installs what okid needs: Debian packages from tools/packages/*.txt and Python packages into .venv.
# usage: tools/setup.sh [build|bench|test|dev|docs|embedded|fuzz|languages|package|programs]   (bench and test include build, the others test)
# Idempotent; silent when nothing is missing. Needs root or sudo only when a Debian package is missing.
set -euo pipefail
cd "$(dirname "$0")/.."
tier=${1:-build}

lists=(tools/packages/debian.txt)
if [ "$tier" = bench ]; then
  lists+=(tools/packages/debian-bench.txt)
  tier=build # Python needs nothing more
fi
[ "$tier" = build ] || lists+=(tools/packages/debian-test.txt)
case $tier in
  embedded|fuzz|languages|package|programs) lists+=("tools/packages/debian-$tier.txt") tier=test ;; # Python needs nothing more
  dev|docs) lists+=(tools/packages/debian-fuzz.txt tools/packages/debian-dev.txt) tier=dev ;;
esac

installed() { [ "$(dpkg-query -W -f='${db:Status-Status}' "$1" 2>/dev/null)" = installed ]; }

command -v dpkg-query >/dev/null || {
  echo "setup: this is not a Debian-like system (no dpkg-query). Install the equivalents of ${lists[*]} by hand," \
       "then run make with OKID_SKIP_APT=1." >&2
  [ "${OKID_SKIP_APT:-}" = 1 ] || exit 4
}

if [ "${OKID_SKIP_APT:-}" != 1 ]; then
  missing=()
  while read -r name _; do
    case $name in ''|'#'*) continue ;; esac
    found=
    for one in ${name//|/ }; do installed "$one" && found=1 && break; done
    [ -n "$found" ] || missing+=("$name")
  done < <(cat "${lists[@]}")

  if [ ${#missing[@]} -gt 0 ]; then
    sudo=
    if [ "$(id -u)" -ne 0 ]; then
      if command -v sudo >/dev/null && { sudo -n true 2>/dev/null || [ -t 0 ]; }; then
        sudo=sudo
      else
        echo "setup: missing Debian packages, and neither root nor sudo is at hand. Ask an administrator to run:" >&2
        echo "  apt-get install --no-install-recommends ${missing[*]%%|*}" >&2
        exit 4
      fi
    fi
    echo "setup: installing ${#missing[@]} Debian packages: ${missing[*]}"
    log=$(mktemp)
    apt() { $sudo env DEBIAN_FRONTEND=noninteractive apt-get -qq -o Dpkg::Use-Pty=0 "$@" >"$log" 2>&1 </dev/null; }
    apt update || { echo "setup: apt-get update failed; going on with the lists at hand:" >&2; tail -n 3 "$log" >&2; }
    want=()
    for name in "${missing[@]}"; do
      pick=${name%%|*}
      for one in ${name//|/ }; do
        [ -n "$(apt-cache policy "$one" 2>/dev/null | sed -n 's/ *Candidate: //p' | grep -v none)" ] && pick=$one && break
      done
      want+=("$pick")
    done
    apt install -y --no-install-recommends "${want[@]}" || {
      echo "setup: apt-get install ${want[*]} failed:" >&2; tail -n 20 "$log" >&2; rm -f "$log"; exit 4; }
    rm -f "$log"
  fi
fi

# The readers that frameworks of boards have for their manifests: a Python of their own, because they want other versions.
if [ "${1:-}" = embedded ] && ! cmp -s tools/pyproject.toml .venv/boards/.okid; then
  [ -x .venv/boards/bin/python ] || python3 -m venv .venv/boards || exit 4
  echo "setup: installing Python packages (boards) into .venv/boards, some minutes the first time"
  python3 tools/requirements.py boards | .venv/boards/bin/python -m pip install --quiet --disable-pip-version-check -r /dev/stdin || {
    echo "setup: pip could not install tools/pyproject.toml [boards]; see the lines above." >&2; exit 4; }
  cp tools/pyproject.toml .venv/boards/.okid
fi

# Python: one .venv, refreshed only when the list of requirements changed. A tier includes the ones before it.
case $tier in
  build) covers="build test dev" ;;
  test) covers="test dev" ;;
  dev) covers="dev" ;;
  *) echo "setup: no tier '$tier' (build, bench, test, dev, docs, embedded, fuzz, languages, package, programs)" >&2; exit 2 ;;
esac
for one in $covers; do
  if cmp -s tools/pyproject.toml ".venv/.okid-$one"; then exit 0; fi
done
[ -x .venv/bin/python ] || python3 -m venv .venv || {
  echo "setup: python3 -m venv failed. Install python3-venv, or remove a half-made .venv, and try again." >&2; exit 4; }
echo "setup: installing Python packages ($tier) into .venv, some minutes the first time"
list=$(mktemp)
.venv/bin/python tools/requirements.py "$tier" >"$list"
.venv/bin/python -m pip install --quiet --disable-pip-version-check -r "$list" || {
  echo "setup: pip could not install tools/pyproject.toml [$tier]; see the lines above." >&2; rm -f "$list"; exit 4; }
rm -f "$list"
.venv/bin/python - <<'PY'
import pathlib, sys, sysconfig, tomllib
# `import okid` from the source tree (the binding finds build/libokid.so beside it), and its commands in .venv/bin.
pathlib.Path(sysconfig.get_paths()["purelib"], "okid-source.pth").write_text(str(pathlib.Path("tools").resolve()) + "\n")
for name, target in tomllib.loads(pathlib.Path("tools/pyproject.toml").read_text())["project"]["scripts"].items():
    module, function = target.split(":")
    command = pathlib.Path(sys.executable).parent / name
    # As pip makes them: what a worker process of a campaign imports must not be the command again.
    command.write_text(f"#!{sys.executable}\nimport sys\nfrom {module} import {function}\n"
                       f'if __name__ == "__main__":\n    sys.exit({function}())\n')
    command.chmod(0o755)
PY
cp tools/pyproject.toml ".venv/.okid-$tier"
