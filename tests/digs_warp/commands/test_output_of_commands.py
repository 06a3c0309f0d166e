"""What whole commands do to the folder that they write: nothing, before they can succeed."""

import signal
from pathlib import Path

import numpy as np
import pytest

import digs_warp
from digs_warp.checks import DigsError
from digs_warp.cli import EXIT_BAD_INPUT, EXIT_OK, main
from digs_warp.data.gaussians import FIELDS, Gaussians
from digs_warp.record.layout import GAUSSIANS
from reference.interrupted_training import train_until
from reference.output_folders import SMALL, names, our_folder, state
from reference.tiny_capture import write_tiny_capture

SHORT = "--iterations 2 --sh-degree 0 --voxel-size 0.05".split()


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_tiny_capture(tmp_path_factory.mktemp("tiny") / "capture", frames=8).folder


def test_a_recording_that_cannot_be_made_changes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("README.txt").write_text("no mesh")
    our_folder(tmp_path / "used")
    before = state(tmp_path)
    for flags in [
        ["--effects", "nosuch", "--tier", "guided"],
        ["--environment", "missing.hdr"],
        ["--mesh", "README.txt"],
        ["--profile", "no-such-camera"],
        ["--meshes", "no/such/*.glb"],
    ]:
        for command in ("simulate", "run"):
            if command == "run" and "--meshes" in flags:
                continue
            assert main([command, "--out", "used", "--overwrite", *SMALL, *flags]) == EXIT_BAD_INPUT
            assert main([command, "--out", "new/folder", *SMALL, *flags]) == EXIT_BAD_INPUT
        assert state(tmp_path) == before


def test_a_reconstruction_that_cannot_be_made_changes_nothing(
    capture: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("empty").mkdir()
    our_folder(tmp_path / "used", "reconstruct")
    before = state(tmp_path)
    for flags in [
        ["--mask-folder", "empty", "--masks", "folder"],
        ["--device", "cuda:7"],
        ["--voxel-size", "1e-9"],
        ["--test-every", "1"],
    ]:
        arguments = ["reconstruct", str(capture), *SHORT, *flags]
        assert main([*arguments, "--out", "used", "--overwrite"]) != EXIT_OK
        assert main([*arguments, "--out", "new/folder"]) != EXIT_OK
        assert state(tmp_path) == before


def test_an_overwrite_that_is_terminated_resumes_to_the_same_bits(
    capture: Path, tmp_path: Path
) -> None:
    """A real SIGTERM in the middle of the training; until the end the old result is as it was."""
    out, alone = tmp_path / "out", tmp_path / "alone"
    options = "--iterations 300 --sh-degree 0 --voxel-size 0.02".split()
    assert main(["reconstruct", str(capture), "--out", str(alone), *options]) == 0
    assert main(["reconstruct", str(capture), "--out", str(out), *SHORT]) == 0
    (out / "notes.txt").write_text("precious")
    before = state(out)
    arguments = ["reconstruct", str(capture), "--out", str(out), *options]
    ended = train_until(signal.SIGTERM, [*arguments, "--overwrite"])
    assert ended.returncode == 143 and "--resume" in ended.stderr
    assert before.items() <= state(out).items()
    assert main([*arguments, "--resume"]) == 0
    one, other = (Gaussians.load(folder / GAUSSIANS) for folder in (out, alone))
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert names(out) == sorted([*names(alone), "notes.txt"])


def test_the_functions_of_the_package_replace_no_file_of_others(
    capture: Path, tmp_path: Path
) -> None:
    (tmp_path / "masks").mkdir()
    (tmp_path / "masks/0001.png").write_text("precious")
    with pytest.raises(DigsError, match="not empty"):
        digs_warp.reconstruct(capture, out=tmp_path, iterations=2, masks="depth")
    with pytest.raises(DigsError, match="not empty"):
        digs_warp.simulate(out=tmp_path, frames=2, width=32, height=18)
    assert names(tmp_path) == ["masks"]
