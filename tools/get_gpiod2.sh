#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Obtain the sources of libgpiod 2, for testing its driver where the system has 1.6; prints the folder that holds
# include/gpiod.h and lib/*.c. They come with the source package of PyPI's gpiod. usage: tools/get_gpiod2.sh PYTHON
set -euo pipefail
python=$1 version=2.4.0
cache=${XDG_CACHE_HOME:-$HOME/.cache}/okid/gpiod-$version
if [ -f "$cache/include/gpiod.h" ]; then echo "$cache"; exit 0; fi
room=$(mktemp -d "${TMPDIR:-/tmp}/okid-gpiod.XXXXXX")
trap 'rm -rf "$room"' EXIT
"$python" -m pip download --quiet --disable-pip-version-check --no-deps --no-binary gpiod -d "$room" "gpiod==$version" \
  >"$room/log" 2>&1 || { echo "get_gpiod2: PyPI's gpiod $version could not be had:" >&2; tail -n 3 "$room/log" >&2; exit 1; }
tar -xf "$room/gpiod-$version.tar.gz" -C "$room"
[ -f "$room/gpiod-$version/lib/chip.c" ] || { echo "get_gpiod2: gpiod-$version.tar.gz holds no lib/chip.c" >&2; exit 1; }
mkdir -p "$(dirname "$cache")"
mv -T "$room/gpiod-$version" "$cache" 2>/dev/null || [ -f "$cache/include/gpiod.h" ] # another run was faster
echo "$cache"
