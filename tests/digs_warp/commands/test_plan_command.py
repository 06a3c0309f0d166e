"""`digs-warp plan`: says what it measured and chose, and writes nothing unless asked."""

import json
from pathlib import Path

import pytest

from digs_warp.cli import EXIT_OK, main

TINY = ["--width", "64", "--samples-per-pixel", "1", "--frames", "2"]


def test_the_plan_names_every_effect_and_lands_in_the_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "plan.json"
    assert main(["plan", *TINY, "--json", str(path), "--effects", "mirror,shot-noise"]) == EXIT_OK
    printed = capsys.readouterr().out
    plan = json.loads(path.read_text())
    assert plan["facts"]["frames"] == 2
    for choice in (*plan["depth"], *plan["color"]):
        state = "on" if choice["on"] else "off"
        (line,) = (row for row in printed.splitlines() if row.split()[:1] == [choice["effect"]])
        assert line.split()[1] == state
        assert choice["statistic"] in line and choice["reason"] in line
    on = {each["effect"] for each in (*plan["depth"], *plan["color"]) if each["on"]}
    assert on == {"mirror", "shot-noise"} and list(tmp_path.iterdir()) == [path]
