"""From words to commands: help, the flags of every command, and suggestions for what is misspelled."""

import re
import subprocess
import sys
from collections.abc import Iterator
from itertools import pairwise

import pytest

from digs_warp.cli import EXIT_OK, EXIT_WRONG_USAGE, main
from digs_warp.commands.command import COMMANDS, Group


def names_below(group: Group) -> Iterator[list[str]]:
    for name, node in group.members.items():
        if isinstance(node, Group):
            yield from ([name, *words] for words in names_below(node))
        else:
            yield [name]


ALL = list(names_below(COMMANDS))


# Help


def help_lines(words: list[str], capsys: pytest.CaptureFixture[str]) -> list[str]:
    assert main(words) == EXIT_OK
    captured = capsys.readouterr()
    assert captured.err == ""
    # Boxes have a border, which becomes spaces where the terminal knows no such signs.
    return captured.out.replace("│", " ").splitlines()


def flags_in(lines: list[str]) -> list[str]:
    return [line.split()[0].strip(",") for line in lines if re.match("  --[a-z]", line)]


def test_help_explains_every_flag_and_names_no_empty_default(capsys) -> None:
    for command in ALL:
        lines = help_lines([*command, "--help-all"], capsys)
        numbers = [n for n, line in enumerate(lines) if re.match(r"  (--[a-z]|[A-Z]{4,} )", line)]
        assert numbers
        for number, following in pairwise([*numbers, len(lines)]):
            # The explanation stands behind the flag or, behind a long one, in the next lines.
            words = " ".join(lines[number:following]).split("(")[0].split()
            assert len(words) >= 4, f"{command}: no help for '{lines[number]}'"
        text = " ".join(line.strip() for line in lines)
        assert not re.search(r"\(default: *(None|''|\"\")?\)", text)


def test_help_shows_the_main_flags_and_counts_the_rest(capsys) -> None:
    for name in ["run", "simulate", "reconstruct"]:
        short = help_lines([name, "--help"], capsys)
        full = help_lines([name, "--help-all"], capsys)
        hidden = set(flags_in(full)) - set(flags_in(short))
        assert set(flags_in(short)) < set(flags_in(full))
        assert len(flags_in(short)) <= 15
        assert len(flags_in(full)) <= 70
        assert short[-1] == f"'digs-warp {name} --help-all' shows {len(hidden)} more flags."
        assert "can be set in a file for --config" in full[-1]


# Suggestions


def test_a_close_miss_is_suggested_in_a_few_lines(capsys) -> None:
    for words, suggestion in [
        (["simulte"], "did you mean 'simulate'?"),
        (["qqq"], "reconstruct"),
        (["usd"], "validate"),
        (["run", "--config", "--out", "x"], "--config needs a file"),
        (["study", "run", "tradof"], "did you mean 'tradeoff'?"),
        (["convert", "a", "--out", "x", "--to", "gsplat"], "Expected one of ("),
        (["run", "--out", "x", "--strategy", "fussion"], "'fusion', 'hull'"),
        (["run", "--out", "x", "--meshh", "a.glb"], "no flag '--meshh'; did you mean '--mesh'?"),
        (
            ["run", "--out", "x", "--samples-per-pixl", "2"],
            "did you mean '--samples-per-pixel'?",
        ),  # hidden
        (["run", "--out", "x", "--quite"], "--quiet"),
        (["run", "--out", "x", "--frames", "q"], "--frames: 'q', expected a whole number"),
        (["render", "a", "--out", "x", "--background", *"q11"], "--background: 'q', expected a"),
        (
            ["run", "--out", "x", "--no-edge-filter"],
            "no flag '--no-edge-filter'; it is the setting reconstruction.init.edge_filter in a file",
        ),
        (["--quite", "run", "--out", "x"], "did you mean '--quiet'?"),
        (["run", "--out", "x", "--test-every", "1"], "digs-warp: --test-every: 1, expected 2 to"),
    ]:
        assert main(words) == EXIT_WRONG_USAGE
        captured = capsys.readouterr()
        assert captured.out == ""
        assert suggestion in captured.err
        assert len(captured.err.splitlines()) <= 16


# The flags of every command


def test_version(capsys) -> None:
    for words in [["--version"], ["info", "--version"], ["--version", "nonsense"]]:
        assert main(words) == EXIT_OK
        assert re.match(r"digs-warp \d+\.\d+", capsys.readouterr().out)


def run_in_process(*words: str) -> subprocess.CompletedProcess[str]:
    program = (
        "import sys, logging; from digs_warp.cli import main\n"
        "from digs_warp.commands.info import Info\n"
        "def execute(self):\n"
        "    for name in ('digs_warp.x', 'digs_warp.kernels', 'PIL'):\n"
        "        for level in (10, 20, 30, 40): logging.getLogger(name).log(level, name)\n"
        "    return 'result'\n"
        "Info.execute = execute; sys.exit(main())"
    )
    return subprocess.run(
        [sys.executable, "-c", program, *words], capture_output=True, text=True, check=True
    )


USUAL = ["WARNING: digs_warp.x", "ERROR: digs_warp.x", "INFO: digs_warp.kernels"]


def test_quiet_and_verbose_change_the_log_and_not_the_result() -> None:
    for words, logged in [
        (["info", "x"], USUAL),
        (["--quiet", "info", "x"], ["ERROR: digs_warp.x"]),
        (["info", "x", "--quiet"], ["ERROR: digs_warp.x"]),
        (["--verbose", "info", "x"], [*USUAL, "DEBUG: digs_warp.x", "DEBUG: digs_warp.kernels"]),
    ]:
        done = run_in_process(*words)
        assert done.stdout == "result\n"
        lines = done.stderr.splitlines()
        assert set(logged) <= set(lines)
        assert ("WARNING: digs_warp.x" in lines) == ("--quiet" not in words)
        assert ("DEBUG: digs_warp.x" in lines) == ("--verbose" in words)
        assert "INFO: PIL" not in lines
