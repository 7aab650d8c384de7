#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# The demonstration: a simulated shaker test of a 3-storey frame, written as CAN frames, played through the front end at several
# times real speed and identified while it plays; then the report. Needs no CAN in the kernel, no root, no hardware.
set -euo pipefail
cd "$(dirname "$0")/.."
out=build/demo
mkdir -p "$out"

echo "== the test rig: simulated 3-storey frame, shaker at storey 1, three accelerometers, 1 % noise, 16 bit, CAN frames"
build/okid simulate tests/replay/demo_rig.toml --log "$out/frame.log" --truth "$out/truth.json" \
  --csv "$out/frame.csv" --dbc "$out/frame.dbc" --config "$out/frame.toml"
echo
echo "== played through the front end at 5 x real speed, identified while it plays"
build/okid replay "$out/frame.log" -c "$out/frame.toml" --speed 5 --events "$out/events.jsonl" --json "$out/result.json"
echo
.venv/bin/python tools/demo_truth.py "$out/result.json" "$out/truth.json"
echo
build/okid convert "$out/frame.log" "$out/captured.csv" -c "$out/frame.toml"
cat >"$out/geometry.toml" <<'TOML'
[geometry] # the storeys of the frame as points on a mast, one metre apart
nodes = [[0, 0, 0], [0, 0, 1], [0, 0, 2], [0, 0, 3]]
dofs = [[2, "x"], [3, "x"], [4, "x"]]
lines = [[1, 2], [2, 3], [3, 4]]
TOML
.venv/bin/python -m okid.report "$out/result.json" --record "$out/captured.csv" --events "$out/events.jsonl" \
  --config "$out/frame.toml" --geometry "$out/geometry.toml" --out "$out/report.html"
cat <<'END'

Look at it:      xdg-open build/demo/report.html
Again by hand:   build/okid replay build/demo/frame.log -c build/demo/frame.toml
Next:            docs/tutorial.md, from the cable to the mass matrix
END
