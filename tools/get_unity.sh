#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Obtain the Unity test framework. usage: tools/get_unity.sh TAG DIR ; prints the folder that holds unity.c.
# Order: upstream at TAG; where the network is closed, tests/unity/src of Debian's cjson source package.
set -euo pipefail
tag=$1 dir=$2
cache=${XDG_CACHE_HOME:-$HOME/.cache}/okid/unity
if [ -f "$cache/src/unity.c" ]; then echo "$cache/src"; exit 0; fi
rm -rf "$dir"; mkdir -p "$dir" "$cache"

if GIT_TERMINAL_PROMPT=0 timeout 30 git clone -q --depth 1 -b "$tag" \
     https://github.com/ThrowTheSwitch/Unity.git "$dir/upstream" 2>"$dir/git.log"; then
  found=$dir/upstream/src
else
  command -v dpkg-source >/dev/null || { echo "get_unity: upstream not reachable and dpkg-dev is missing" >&2; exit 1; }
  # A private copy of apt's configuration with source entries switched on; the system's stays as it is.
  mkdir -p "$dir/apt/lists/partial" "$dir/apt/parts"
  eval "$(apt-config shell sources Dir::Etc::sourcelist/f parts Dir::Etc::sourceparts/d)"
  for file in "${sources:-}" "${parts:-/nowhere}"/*.list "${parts:-/nowhere}"/*.sources; do
    [ -f "$file" ] || continue
    case $file in
      *.sources) sed 's/^Types:.*/Types: deb-src/' "$file" >"$dir/apt/parts/$(basename "$file")" ;;
      *) sed -n 's/^deb[[:space:]]/deb-src /p' "$file" >"$dir/apt/parts/$(basename "$file")" ;;
    esac
  done
  options=(-qq -o Dir::Etc::sourcelist=/dev/null -o "Dir::Etc::sourceparts=$dir/apt/parts"
           -o "Dir::State::lists=$dir/apt/lists" -o "Dir::Cache::srcpkgcache=" -o "Dir::Cache::pkgcache="
           -o APT::Sandbox::User=)
  apt-get "${options[@]}" update >"$dir/apt.log" 2>&1 || true # a third-party list without sources may fail
  (cd "$dir" && apt-get "${options[@]}" source cjson >>"$dir/apt.log" 2>&1) || {
    echo "get_unity: neither upstream ($tag) nor Debian's source package cjson could be had:" >&2
    tail -n 3 "$dir/git.log" "$dir/apt.log" >&2; exit 1; }
  found=$(echo "$dir"/cjson-*/tests/unity/src)
fi
[ -f "$found/unity.c" ] || { echo "get_unity: no unity.c in $found" >&2; exit 1; }
mkdir -p "$cache.part.$$/src" "$cache.part.$$/examples"
cp "$found"/unity*.[ch] "$cache.part.$$/src/"
[ ! -f "$found/../examples/unity_config.h" ] || cp "$found/../examples/unity_config.h" "$cache.part.$$/examples/"
rm -rf "$cache"; mv "$cache.part.$$" "$cache"
echo "$cache/src"
