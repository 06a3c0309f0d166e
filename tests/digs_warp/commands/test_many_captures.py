"""Several captures in one command: a folder for each, one line for each, and the same bits as alone."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from digs_warp.cli import EXIT_BAD_INPUT, EXIT_OK, main
from digs_warp.commands.many_captures import find_jobs
from digs_warp.data.gaussians import Gaussians
from digs_warp.engines.task import RESULTS
from reference.tiny_capture import write_tiny_capture

SHORT = ["--iterations", "10", "--sh-degree", "0", "--quiet"]


def assert_same_gaussians(one: Path, other: Path) -> None:
    first, second = (Gaussians.load(folder / "gaussians.npz") for folder in (one, other))
    for name, values in vars(first).items():
        np.testing.assert_array_equal(values, getattr(second, name))


@pytest.fixture
def captures(tmp_path: Path) -> Path:
    """Two captures, one of them empty at first sight, in a folder of many scenes."""
    folder = tmp_path / "set"
    write_tiny_capture(folder / "mug" / "00")
    shutil.copytree(folder / "mug" / "00", folder / "boot" / "00")
    (folder / "summary.json").write_text('{"scenes": []}')
    return folder


def test_each_capture_gets_what_it_gets_alone(
    captures: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    command = ["reconstruct", str(captures), "--out", str(out), *SHORT]
    assert main(command) == EXIT_OK
    assert "2 captures" in capsys.readouterr().out
    alone = tmp_path / "alone"
    assert main(["reconstruct", str(captures / "mug/00"), "--out", str(alone), *SHORT]) == EXIT_OK
    assert_same_gaussians(alone, out / "mug/00")
    lines = [json.loads(line) for line in (out / RESULTS).read_text().splitlines()]
    assert sorted(line["name"] for line in lines) == ["boot/00", "mug/00"]
    assert all(line["scores"]["psnr_object"] > 10 for line in lines)

    (out / "boot/00/gaussians.npz").unlink()
    kept = (out / "mug/00/gaussians.npz").stat().st_mtime_ns
    assert main([*command, "--resume"]) == EXIT_OK
    assert_same_gaussians(alone, out / "boot/00")
    assert (out / "mug/00/gaussians.npz").stat().st_mtime_ns == kept
    assert len((out / RESULTS).read_text().splitlines()) == 3
    assert main(["info", str(out)]) == EXIT_OK
    assert "2 captures" in capsys.readouterr().out


def test_a_capture_that_fails_does_not_stop_the_rest(
    captures: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (captures / "boot/00/transforms.json").write_text("{}")
    sources = [str(captures / name / "00") for name in ("boot", "mug")]
    assert main(["reconstruct", *sources, "--out", str(tmp_path / "out"), *SHORT]) == EXIT_BAD_INPUT
    assert "1 of 2 captures failed" in capsys.readouterr().err
    assert (tmp_path / "out/mug/00/gaussians.npz").is_file()


def test_names_are_what_the_paths_do_not_share(captures: Path, tmp_path: Path) -> None:
    write_tiny_capture(tmp_path / "other")
    names = [job.name for job in find_jobs([captures, tmp_path / "other"])]
    assert names == ["set/boot/00", "set/mug/00", "other"]
