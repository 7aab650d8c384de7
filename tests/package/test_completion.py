# SPDX-License-Identifier: MIT
"""What a shell offers when a command line of okid is half typed: the scripts of `okid completion`, in real shells."""

from __future__ import annotations

import os
import pathlib
import pty
import re
import subprocess
from collections.abc import Callable

import pytest
from program import PROGRAM as OKID

ROOT = pathlib.Path(__file__).resolve().parents[2]
COMMANDS = [
    "identify",
    "run",
    "record",
    "replay",
    "simulate",
    "convert",
    "init",
    "check",
    "doctor",
    "compare",
    "merge",
    "bench",
    "support-bundle",
    "completion",
]
FIXED = {  # options of okid identify with fixed choices
    "--method": ["auto", "okid-era", "okid-era-dc", "n4sid-moesp", "n4sid-cva", "n4sid-ssarx", "plscf"],
    "--hankel": ["system", "innovations", "literal"],
    "--hold": ["auto", "zoh", "foh", "band"],
    "--detrend": ["none", "mean", "linear"],
    "--start": ["moving", "rest"],
    "--sensing": ["acceleration", "velocity", "displacement"],
}

Ask = Callable[[str], list[str]]


def okid(*arguments: str, code: int = 0) -> str:
    done = subprocess.run([OKID, *arguments], capture_output=True, text=True, timeout=1800)
    assert done.returncode == code, done.stderr
    return done.stdout if code == 0 else done.stderr


@pytest.fixture()
def folder(tmp_path: pathlib.Path) -> pathlib.Path:
    """A folder as it stands after a day of measuring."""
    for name in ("frame.toml", "frame.log", "frame.csv", "frame.dbc", "run.okj", "result.json", "first blow.csv"):
        (tmp_path / name).touch()
    (tmp_path / "runs").mkdir()
    (tmp_path / "identify").mkdir()
    (tmp_path / "runs" / "monday.toml").touch()
    return tmp_path


def bash_asked(line: str, folder: pathlib.Path) -> list[str]:
    """COMPREPLY of a real bash. A blank at the end: the word after it; `=` parts words as in COMP_WORDBREAKS."""
    words = [part for word in re.split(r"(?<!\\) ", line) for part in re.split(r"(=)", word) if part or word == ""]
    script = folder.parent / "okid.bash"
    script.write_text(okid("completion", "bash"))
    program = 'source "$1"; shift; COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _okid; printf "%s\\n" "${COMPREPLY[@]}"'
    done = subprocess.run(
        ["bash", "--norc", "-c", program, "bash", str(script), *words],
        capture_output=True,
        text=True,
        cwd=folder,
        timeout=1800,
    )
    assert done.returncode == 0 and not done.stderr, done.stderr
    return sorted(done.stdout.split("\n")[:-1]) if done.stdout.strip() else []


def fish_asked(line: str, folder: pathlib.Path) -> list[str]:
    script = folder.parent / "okid.fish"
    script.write_text(okid("completion", "fish"))
    environment = os.environ | {"HOME": str(folder.parent), "XDG_CONFIG_HOME": str(folder.parent / "config")}
    done = subprocess.run(
        ["fish", "--no-config", "-c", "source $argv[1]; complete -C $argv[2]", str(script), line],
        capture_output=True,
        text=True,
        cwd=folder,
        timeout=1800,
        env=environment,
    )
    assert done.returncode == 0 and not done.stderr, done.stderr
    return sorted(each.split("\t")[0] for each in done.stdout.splitlines())


def zsh_typed(line: str, folder: pathlib.Path) -> str:
    """The words that zsh runs when `line`, tab and return are typed at a terminal."""
    (folder.parent / "_okid").write_text(okid("completion", "zsh"))
    (folder.parent / "zdot").mkdir(exist_ok=True)
    (folder.parent / "zdot" / ".zshrc").write_text(
        f"fpath=({folder.parent} $fpath); autoload -Uz compinit; compinit -u -d {folder.parent}/dump\n"
        "unsetopt zle_bracketed_paste beep prompt_sp; PS1=''; bindkey '^I' complete-word\n"
        "okid() { printf 'RAN<%s>' \"${(j:|:)@}\"; exit 0 }\n"
    )
    pid, fd = pty.fork()
    if pid == 0:
        os.chdir(folder)
        os.environ.update(ZDOTDIR=str(folder.parent / "zdot"), TERM="dumb", HOME=str(folder.parent))
        os.execvp("zsh", ["zsh", "-d", "-i"])
    seen = b""
    try:
        os.write(fd, line.encode() + b"\t\n")
        while b"RAN<" not in seen or b">" not in seen.split(b"RAN<")[-1]:
            seen += os.read(fd, 4096)
    except OSError:  # the terminal is closed when zsh has gone
        pass
    finally:
        os.close(fd)
        os.waitpid(pid, 0)
    found = re.findall(r"RAN<(.*?)>", seen.decode(), re.S)
    assert found, seen.decode()
    return str(found[-1])


SHELLS = {"bash": bash_asked, "fish": fish_asked}


@pytest.fixture(params=["bash", pytest.param("fish", marks=pytest.mark.programs)])
def ask(request: pytest.FixtureRequest, folder: pathlib.Path) -> Ask:
    return lambda line: SHELLS[request.param](line, folder)


def test_commands(ask: Ask) -> None:
    assert ask("okid ") == sorted(COMMANDS)
    assert ask("okid re") == ["record", "replay"]
    assert ask("okid completion ") == ["bash", "fish", "zsh"]


@pytest.mark.parametrize("command", COMMANDS)
def test_every_option_of_the_help_is_offered(ask: Ask, command: str) -> None:
    """Neither more nor less than `--help` lists."""
    listed = re.findall(r"^ +(?:-\w,)?(--[\w-]+)", okid(command, "--help"), re.M)
    assert ask(f"okid {command} --") == sorted(listed)


@pytest.mark.parametrize("option", FIXED)
def test_fixed_choices(ask: Ask, option: str, folder: pathlib.Path) -> None:
    """The choices offered are those that the program names when it is given another."""
    assert ask(f"okid identify {option} ") == sorted(FIXED[option])
    assert ask(f"okid identify {option}={FIXED[option][1]}")[0].endswith(FIXED[option][1])
    (folder / "frame.csv").write_text("a,b\n1,2\n")
    said = okid("identify", str(folder / "frame.csv"), "--inputs", "a", "--outputs", "b", option, "none-such", code=2)
    assert said.split("expected one of:")[1].strip().split(", ") == FIXED[option]


def test_files_by_ending(ask: Ask) -> None:
    assert [name.rstrip("/") for name in ask("okid run ")] == ["frame.toml", "identify", "runs"]
    assert ask("okid run runs/") == ["runs/monday.toml"]
    assert ask("okid run fr") == ["frame.toml"]
    assert ask("okid replay r")[0] == "run.okj"
    assert ask("okid replay fr") == ["frame.log"]
    assert ask("okid replay frame.log -c fr") == ["frame.toml"]
    assert ask("okid replay frame.log --config fr") == ["frame.toml"]
    assert ask("okid convert fr") == ["frame.csv", "frame.log"]
    assert ask("okid identify --json res") == ["result.json"]


def test_a_command_is_the_first_word_without_dashes(ask: Ask) -> None:
    """A folder of the name of a command does not count, nor does the value of an option."""
    assert ask("okid identify --hold foh fr") == ["frame.csv"]
    assert "--inputs" not in ask("okid run identify --")


def test_folders(ask: Ask) -> None:
    assert [each.rstrip("/") for each in ask("okid record --directory r")] == ["runs"]


def test_nothing_is_offered_for_a_number(ask: Ask) -> None:
    assert ask("okid identify --fs ") == []


def test_bash_knows_how_many_files_there_are(folder: pathlib.Path) -> None:
    assert "--duration" in bash_asked("okid run frame.toml ", folder)  # no second config: options
    assert bash_asked("okid identify frame.csv fr", folder) == ["frame.csv"]  # as many records as one likes
    assert bash_asked("okid identify first\\ b", folder) == ["first blow.csv"]


@pytest.mark.programs
def test_zsh(folder: pathlib.Path) -> None:
    """What tab makes of a line at a terminal."""
    assert zsh_typed("okid ident", folder) == "identify"
    assert zsh_typed("okid identify --hold f", folder) == "identify|--hold|foh"
    assert zsh_typed("okid identify --hold=f", folder) == "identify|--hold=foh"
    assert zsh_typed("okid identify --stab", folder) == "identify|--stabilization"
    assert zsh_typed("okid run fr", folder) == "run|frame.toml"
    assert zsh_typed("okid replay frame.log -c fr", folder) == "replay|frame.log|-c|frame.toml"
    assert zsh_typed("okid convert frame.log frame.c", folder) == "convert|frame.log|frame.csv"
    assert zsh_typed("okid record --directory ru", folder) == "record|--directory|runs"


@pytest.mark.programs
def test_zsh_sourced(folder: pathlib.Path) -> None:
    """`source <(okid completion zsh)` registers it."""
    script = folder / "okid.zsh"
    script.write_text(okid("completion", "zsh"))
    program = f"autoload -Uz compinit; compinit -u -D; source {script}; print $_comps[okid]"
    done = subprocess.run(["zsh", "-f", "-c", program], capture_output=True, text=True, timeout=1800)
    assert done.stdout.strip() == "_okid" and not done.stderr


def test_wrong_usage() -> None:
    assert "bash" in okid("completion", "ksh", code=2)
    assert "shell" in okid("completion", code=2)
    assert "source <(okid completion bash)" in okid("completion", "--help")
