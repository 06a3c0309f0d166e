"""Every example runs from beginning to end, at a tiny size; each is short."""

import ast
import json
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.record import simulate

EXAMPLES = sorted((Path(__file__).resolve().parent.parent / "examples").glob("*.py"))
SIZE = ["96", "6"]  # width of the images and number of frames


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_the_example_runs(
    example: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    if "torch" in example.stem:
        pytest.importorskip("torch", reason="torch is not installed")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [str(example), *SIZE])
    runpy.run_path(str(example), run_name="__main__")
    assert capsys.readouterr().out


def test_the_notebook_runs_and_shows_pictures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    notebook = json.loads((EXAMPLES[0].parent / "tour.ipynb").read_text())
    names: dict[str, object] = {}
    cards = []
    for cell in notebook["cells"]:
        if cell["cell_type"] != "code":
            continue
        *before, last = ast.parse("".join(cell["source"])).body
        exec(compile(ast.Module(before, []), "cell", "exec"), names)
        assert isinstance(last, ast.Expr)
        shown = eval(compile(ast.Expression(last.value), "cell", "eval"), names)
        cards += [shown._repr_html_()] if hasattr(shown, "_repr_html_") else []
    assert [card.count("<img") for card in cards] == [2, 2, 1]
    assert (tmp_path / "scene.usdz").is_file()


def test_the_examples_are_few_numbered_and_short() -> None:
    assert 1 <= len(EXAMPLES) <= 10
    assert [int(path.name[:2]) for path in EXAMPLES] == list(range(1, len(EXAMPLES) + 1))
    assert max(len(path.read_text().splitlines()) for path in EXAMPLES) < 60


def test_the_noise_project_says_what_it_lacks_and_passes_where_it_is_copied(tmp_path: Path) -> None:
    project = shutil.copytree(EXAMPLES[0].parent / "noise_project", tmp_path / "project")

    def tested() -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "pytest", "-q", "--strict-markers"]
        return subprocess.run(command, cwd=project, capture_output=True, text=True, check=False)

    done = tested()
    assert done.returncode == pytest.ExitCode.USAGE_ERROR
    assert "recordings/shelf" in done.stderr and "sensor_noise" in done.stderr
    config = SimulateConfig(frames=2, width=160, height=90, tier="law")
    simulate(config, project / "recordings/shelf")
    done = tested()
    assert "4 passed" in done.stdout, done.stdout + done.stderr
