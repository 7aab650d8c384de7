#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# The demonstration: a shaker test of a 3-storey frame, recorded as CAN frames, played through the front end at several
# times real speed and identified while it plays; then the report. Needs no CAN in the kernel, no root, no hardware.
set -euo pipefail
cd "$(dirname "$0")/.."
out=build/demo
mkdir -p "$out"

echo "== the test rig: 3-storey frame, shaker at storey 1, three accelerometers, 1 % noise, 16 bit, CAN frames"
build/okid simulate tests/replay/demo_rig.toml --log "$out/frame.log" --truth "$out/truth.json" \
  --csv "$out/frame.csv" --dbc "$out/frame.dbc" --config "$out/frame.toml"
echo
echo "== played through the front end at 5 x real speed, identified while it plays"
build/okid replay "$out/frame.log" -c "$out/frame.toml" --speed 5 --events "$out/events.jsonl" --json "$out/result.json"
echo
.venv/bin/python tools/demo_truth.py "$out/result.json" "$out/truth.json"
echo
build/okid convert "$out/frame.log" "$out/captured.csv" -c "$out/frame.toml"
.venv/bin/python -m okid.report "$out/result.json" --record "$out/captured.csv" --out "$out/report.html"
