# SPDX-License-Identifier: MIT
"""DBC files with nested multiplexors, value ranges, long names and Latin-1: okid decodes what cantools does."""

from __future__ import annotations

import json
from pathlib import Path

import cantools
import program
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

RATE = 100
HEAD = f'[acquisition]\nrate_hz = {RATE}\n[[bus]]\nname = "b"\ninterface = "can0"\ndbc = "a.dbc"\n'

# The section that every file written by a Vector tool has.
KEYWORDS = "NS_ :\n" + "".join(
    f"\t{word}\n"
    for word in (
        "NS_DESC_ CM_ BA_DEF_ BA_ VAL_ CAT_DEF_ CAT_ FILTER BA_DEF_DEF_ EV_DATA_ ENVVAR_DATA_ SGTYPE_ SGTYPE_VAL_ "
        "BA_DEF_SGTYPE_ BA_SGTYPE_ SIG_TYPE_REF_ VAL_TABLE_ SIG_GROUP_ SIG_VALTYPE_ SIGTYPE_VALTYPE_ BO_TX_BU_ "
        "BA_DEF_REL_ BA_REL_ BA_DEF_DEF_REL_ BU_SG_REL_ BU_EV_REL_ BU_BO_REL_ SG_MUL_VAL_"
    ).split()
) + "\nBS_:\n\n"  # fmt: skip


def channel(name: str, role: str = "aux", message: str = "M") -> str:
    return (
        f'[[channel]]\nname = "{name}"\nrole = "{role}"\nmessage = {json.dumps(message)}\nsignal = {json.dumps(name)}\n'
    )


def ranges(draw: st.DrawFn) -> list[tuple[int, int]]:
    pieces = draw(st.lists(st.tuples(st.integers(0, 7), st.integers(0, 3)), min_size=1, max_size=3))
    return [(low, min(7, low + more)) for low, more in pieces]


@st.composite
def messages(draw: st.DrawFn) -> str:
    """Outer multiplexor in byte 0, an inner one in byte 1, four signals behind them and one that is always there."""
    inner = ranges(draw)
    text = f'VERSION ""\n{KEYWORDS}BU_: X\n\nBO_ 291 M: 8 X\n SG_ Outer M : 0|8@1+ (1,0) [0|0] "" X\n'
    text += f' SG_ Inner m{inner[0][0]}M : 8|8@1+ (1,0) [0|0] "" X\n SG_ Always : 16|8@1+ (1,0) [0|0] "" X\n'
    tail = f"SG_MUL_VAL_ 291 Inner Outer {', '.join(f'{a}-{b}' for a, b in inner)};\n"
    for i in range(4):
        values, big = ranges(draw), draw(st.booleans())
        start = 24 + 8 * i + (7 if big else 0)
        sign, scale = draw(st.sampled_from("+-")), draw(st.sampled_from([1, 0.5, -2]))
        text += f' SG_ S{i} m{values[0][0]} : {start}|8@{0 if big else 1}{sign} ({scale},{i}) [0|0] "" X\n'
        outer = draw(st.sampled_from(["Outer", "Inner"]))
        tail += f"SG_MUL_VAL_ 291 S{i} {outer} {', '.join(f'{a}-{b}' for a, b in values)};\n"
    return text + '\nVAL_ 291 Outer 1 "SG_ one" 2 "two";\n' + tail


@settings(max_examples=15, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
@given(text=messages(), data=st.data())
def test_nested_multiplexors_are_those_of_cantools(tmp_path: Path, text: str, data: st.DataObject) -> None:
    (tmp_path / "a.dbc").write_text(text)
    message = cantools.database.load_string(text, "dbc").messages[0]
    frames = [
        bytes(data.draw(st.tuples(st.integers(0, 8), st.integers(0, 8)))) + data.draw(st.binary(min_size=6, max_size=6))
        for _ in range(24)
    ]
    for name in ("S0", "S1", "S2", "S3", "Inner"):
        (tmp_path / "a.toml").write_text(HEAD + channel(name, "acceleration"))
        with_it = [(f, v[name]) for f in frames if name in (v := decode_what_is_there(message, f))]
        without = [f for f in frames if name not in decode_what_is_there(message, f)]
        for some, status in ((with_it, 0), ([(f, 0.0) for f in without], 3)):
            if not some:
                continue
            rows = [f"({n / RATE:.6f}) can0 123#{frame.hex().upper()}\n" for n, (frame, _) in enumerate(some)]
            (tmp_path / "a.log").write_text("".join(rows))
            done = program.okid("convert", tmp_path / "a.log", tmp_path / "a.csv", "-c", tmp_path / "a.toml")
            assert done.returncode == status, (name, text, done.stderr)
            if status == 0:
                cells = [float(row) for row in (tmp_path / "a.csv").read_text().splitlines()[3:]]
                assert cells == [value for _, value in some], (name, text)


def decode_what_is_there(message: cantools.database.can.Message, frame: bytes) -> dict[str, float]:
    """Signals of a frame by cantools' own tree, pages that are in none of its branches left out."""
    found: dict[str, float] = {}

    def walk(level: list) -> None:
        for entry in level:
            name = next(iter(entry)) if isinstance(entry, dict) else entry
            signal = message.get_signal_by_name(name)
            raw = int.from_bytes(frame[signal.start // 8 : signal.start // 8 + 1], "big", signed=signal.is_signed)
            found[name] = float(signal.conversion.raw_to_scaled(raw, decode_choices=False))
            if isinstance(entry, dict):
                walk(entry[name].get(raw, []))

    walk(message.signal_tree)
    return found


def test_a_plain_signal_beside_a_multiplexed_one(tmp_path: Path) -> None:
    """Every frame carries the plain one; a page carries its own too."""
    (tmp_path / "a.dbc").write_text(
        'BO_ 291 M: 8 X\n SG_ Page M : 0|8@1+ (1,0) [0|0] "" X\n SG_ Even m0 : 8|8@1+ (1,0) [0|0] "" X\n'
        ' SG_ Odd m1 : 8|8@1+ (1,0) [0|0] "" X\n SG_ Plain : 16|8@1+ (1,0) [0|0] "" X\n'
    )
    (tmp_path / "a.log").write_text(
        "".join(f"({n / RATE:.6f}) can0 123#{n % 2:02X}{n:02X}{n + 100:02X}\n" for n in range(40))
    )
    for name, first, step, more in (("Even", 0, 2, 0), ("Odd", 1, 2, 0), ("Plain", 0, 1, 100)):
        rate = HEAD.replace("rate_hz = 100", f"rate_hz = {RATE // step}")
        other = channel("Plain" if name != "Plain" else "Odd")
        (tmp_path / "a.toml").write_text(rate + channel(name, "acceleration") + other)
        done = program.okid("convert", tmp_path / "a.log", tmp_path / "a.csv", "-c", tmp_path / "a.toml")
        assert done.returncode == 0, done.stderr
        found = [float(row.split(",")[0]) for row in (tmp_path / "a.csv").read_text().splitlines()[3:]]
        numbers = [value for value in found if value == value]
        wanted = [float(n + more) for n in range(first, 40, step)]
        assert len(numbers) >= len(wanted) - 2 and numbers == wanted[wanted.index(numbers[0]) :][: len(numbers)]


def test_long_names_and_latin_1(tmp_path: Path) -> None:
    long_signal, long_message = "Acceleration_of_the_upper_bearing_x", "Message_with_a_name_of_more_than_32_letters"
    text = (
        'VERSION ""\nBU_: X\nBO_ 291 Message_with_a_name_of_more_than: 8 X\n'
        ' SG_ Acceleration_of_the_upper_bearin : 0|16@1- (0.1,0) [0|0] "°" X\n'
        'CM_ SG_ 291 Acceleration_of_the_upper_bearin "über\n BO_ 5 Nothing: 8 X";\n'
        'BA_DEF_ SG_ "SystemSignalLongSymbol" STRING;\nBA_DEF_ BO_ "SystemMessageLongSymbol" STRING;\n'
        f'BA_ "SystemMessageLongSymbol" BO_ 291 "{long_message}";\n'
        f'BA_ "SystemSignalLongSymbol" SG_ 291 Acceleration_of_the_upper_bearin "{long_signal}";\n'
    )
    (tmp_path / "a.dbc").write_bytes(text.encode("latin-1"))
    database = cantools.database.load_file(tmp_path / "a.dbc", encoding="latin-1")
    assert database.messages[0].name == long_message and database.messages[0].signals[0].name == long_signal
    for message, signal in [
        (long_message, long_signal),
        ("Message_with_a_name_of_more_than", "Acceleration_of_the_upper_bearin"),
    ]:
        (tmp_path / "a.toml").write_text(HEAD + channel(signal, "acceleration", message))
        done = program.okid("check", tmp_path / "a.toml", "--json")
        assert done.returncode == 0, done.stderr
        found = json.loads(done.stdout)["channels"][0]
        assert (found["can_id"], found["scale"], found["unit"]) == (291, 0.1, "°")


def test_multiplexors_in_a_circle_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.dbc").write_text(
        'BO_ 291 M: 8 X\n SG_ A m0M : 0|8@1+ (1,0) [0|0] "" X\n SG_ B m0M : 8|8@1+ (1,0) [0|0] "" X\n'
        "SG_MUL_VAL_ 291 A B 0-0;\nSG_MUL_VAL_ 291 B A 0-0;\n"
    )
    (tmp_path / "a.toml").write_text(HEAD + channel("A", "acceleration"))
    done = program.okid("check", tmp_path / "a.toml")
    assert done.returncode == 2 and "has multiplexors in a circle" in done.stderr, done.stderr
