"""`digs-warp sensor fit` from the command line: files, messages, and that the profile can be used."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.cli import EXIT_BAD_INPUT, EXIT_OK, main
from digs_warp.data.capture_writer import CaptureWriter, FrameImages
from digs_warp.data.rig import Rig
from digs_warp.sim.camera.profiles import load_profile
from reference.textured_wall import PLACES, record_wall

NOISE, FIELD = 3.0, 0.2


@pytest.fixture(scope="module")
def wall(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of a wall from two places, two frames each."""
    rig = replace(load_profile("bare-matcher").rig(240, 136), image_noise=NOISE, static_field=FIELD)
    writer = CaptureWriter(tmp_path_factory.mktemp("wall"), rig.intrinsics, Rig(rig.baseline))
    record_wall(writer, rig, "guided", PLACES[1:3], frames=2)
    return writer.folder or Path()


def fit(*words: str | Path) -> int:
    return main(["sensor", "fit", "--quiet", *map(str, words)])


def test_the_profile_has_the_figures_and_can_be_used(wall: Path, tmp_path: Path, capsys) -> None:
    out = tmp_path / "mine.yaml"
    assert fit(wall, "--out", out, "--base", "oak-d") == EXIT_OK
    shown = capsys.readouterr().out
    assert "4 frames of a wall at" in shown and f"--profile {out}" in shown
    assert "beware: 2 distances; 4 to 6 are better" in shown
    profile = load_profile(out)
    noise = profile.figures["image_noise"]
    assert noise.value == pytest.approx(NOISE, rel=0.03)
    assert noise.origin == "measured" and noise.note.startswith("+- 0.")
    rig = profile.rig()
    assert (rig.intrinsics.width, rig.intrinsics.height, rig.baseline) == (240, 136, 0.12)
    assert rig.window == load_profile("oak-d").rig().window
    page = out.with_suffix(".html").read_text()
    for part in ("Measured beside simulated", "What this recording cannot tell", "m [px]"):
        assert part in page


def test_wrong_flags_and_files_in_the_way_are_refused(
    wall: Path, tmp_path: Path, monkeypatch, capsys
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.html").write_text("of somebody else")
    for words, message in [
        (["--out", "mine.yaml"], "mine.html': the file exists; add --overwrite"),
        (["--out", "p.json"], "suffix '.json', expected .yaml or .yml"),
        (["--out", "p.yaml", "--base", "zed2"], "--base 'zed2': unknown; did you mean 'zed2-"),
        (["--out", "p.yaml", "--distances", "1", "2", "3"], "3 values, expected 2, one for each"),
        (["--out", "p.yaml", "--distances", "2", "1"], "not in rising order"),
    ]:
        assert fit(wall, *words) == EXIT_BAD_INPUT
        assert message in capsys.readouterr().err
        assert [path.name for path in tmp_path.iterdir()] == ["mine.html"]


def test_a_recording_of_something_else_is_no_wall(tmp_path: Path, capsys) -> None:
    rig = load_profile("bare-matcher").rig(64, 48)
    writer = CaptureWriter(tmp_path / "fence", rig.intrinsics, Rig(rig.baseline))
    fence = np.where(np.indices((48, 64))[1] // 8 % 2, 0.2, 0.6)
    images = FrameImages(image=np.zeros((48, 64, 3), np.uint8), depth=fence.astype(np.float32))
    writer.write_frame(0, images)
    writer.add_pose(0, np.eye(4), 0.0)
    writer.finish()
    assert fit(tmp_path / "fence", "--out", tmp_path / "p.yaml") == EXIT_BAD_INPUT
    message = capsys.readouterr().err
    assert "frame '0000'" in message and "of a plane, expected 60% or more" in message
