"""Recording a capture: complete, reproducible, resumable, and honest about bad settings."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.capture import read_capture
from digs_warp.data.images import write_image
from digs_warp.geometry.camera import pixel_centers
from digs_warp.record.files import read_json
from digs_warp.record.manifest import Manifest
from digs_warp.sim.record.inputs import load_inputs
from digs_warp.sim.record.record import SimulateConfig, simulate
from reference.file_hashes import file_hashes

BOX = """v -1 -1 -1
v 1 -1 -1
v 1 1 -1
v -1 1 -1
v -1 -1 1
v 1 -1 1
v 1 1 1
v -1 1 1
f 1 4 3 2
f 5 6 7 8
f 1 2 6 5
f 2 3 7 6
f 3 4 8 7
f 4 1 5 8
"""


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> SimulateConfig:
    """A box of 0.4 m under a noisy sky, four small frames of an odd size."""
    folder = tmp_path_factory.mktemp("input")
    (folder / "box.obj").write_text(BOX)
    sky = np.random.default_rng(0).integers(0, 256, (16, 32, 3), dtype=np.uint8)
    write_image(folder / "sky.png", sky)
    return SimulateConfig(
        profile="bare-matcher",
        mesh=folder / "box.obj",
        environment=folder / "sky.png",
        frames=4,
        width=83,
        height=47,
        samples_per_pixel=2,
        object_size=0.4,
        up="z",
        tier="law",
        ground="none",
    )


@pytest.fixture(scope="module")
def recording(config: SimulateConfig, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The finished capture folder."""
    folder = tmp_path_factory.mktemp("recording") / "capture"
    simulate(config, folder)
    return folder


def test_every_frame_has_all_its_images(recording: Path) -> None:
    capture = read_capture(recording)
    assert len(capture) == 4 and capture.rig is not None and capture.rig.baseline == 0.12
    for frame in capture.frames:
        assert frame.load_image().shape == frame.load_right_image().shape == (47, 83, 3)
        mask, true, sensed = frame.load_mask(), frame.load_depth_true(), frame.load_depth()
        assert 0.02 < (mask == 255).mean() < 0.6
        assert np.isfinite(true).all()
        assert not np.array_equal(true, sensed)
        # 0.1 px of noise on disparities of at least 7 px: 1.5 %.
        near = true < 1.3
        assert near.sum() > 100
        np.testing.assert_allclose(sensed[near], true[near], rtol=0.1)


def test_true_depth_puts_the_object_back_where_it_stands(recording: Path) -> None:
    for frame in read_capture(recording).frames:
        points = frame.camera.unproject(pixel_centers(83, 47), frame.load_depth_true())
        # Two samples may both hit where the center just misses.
        solid = points[(frame.load_mask() == 255) & (frame.load_depth_true() < 2.0)]
        np.testing.assert_allclose(np.abs(solid).max(axis=1), 0.2, atol=1e-5)


def test_the_run_record_tells_settings_times_and_hashes(
    recording: Path, config: SimulateConfig
) -> None:
    record = read_json(recording / "run.json", "record")
    assert record["settings"]["frames"] == 4 and record["settings"]["mesh"] == str(config.mesh)
    assert {"load", "prepare", "render", "sense", "write"} <= record["seconds"].keys()
    assert Manifest.read(recording).names == set(file_hashes(recording))
    assert len(file_hashes(recording)) == 4 * 5 + 1


def test_a_resumed_run_makes_missing_frames_again(
    recording: Path, config: SimulateConfig, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    folder = tmp_path / "capture"
    shutil.copytree(recording, folder)
    (folder / "masks/0001.png").unlink()
    (folder / "depth/0002.exr").unlink()
    kept = (folder / "images/0000.png").stat().st_mtime_ns
    simulate(config, folder, resume=True)
    assert "2 files are missing and made again: depth/0002.exr, masks/0001" in caplog.text
    assert file_hashes(folder) == file_hashes(recording)
    assert (folder / "images/0000.png").stat().st_mtime_ns == kept


def test_the_recording_of_others_is_left_alone(
    recording: Path, config: SimulateConfig, tmp_path: Path
) -> None:
    with pytest.raises(DigsError, match="already holds a recording"):
        simulate(config, recording)
    (tmp_path / "transforms.json").write_text("{}")
    with pytest.raises(DigsError, match="already holds a recording"):
        simulate(config, tmp_path, resume=True)
    folder = tmp_path / "capture"
    shutil.copytree(recording, folder)
    with pytest.raises(DigsError, match=r"other settings \(frames 4 -> 5, seed 0 -> 3\)"):
        simulate(replace(config, frames=5, seed=3), folder, resume=True)
    assert file_hashes(folder) == file_hashes(recording)


def test_strength_scales_the_errors(config: SimulateConfig, tmp_path: Path) -> None:
    errors = []
    for strength in (0.0, 1.0, 3.0):
        changed = replace(config, frames=1, strength=strength)
        (frame,) = simulate(changed, tmp_path / str(strength)).frames
        near = frame.load_depth_true() < 1.3
        errors.append(np.std((frame.load_depth() - frame.load_depth_true())[near]))
    assert errors[0] == 0
    assert errors[2] == pytest.approx(3 * errors[1], rel=0.1)


@pytest.mark.parametrize("name", ["frames", "samples_per_pixel", "object_size", "seed"])
def test_impossible_settings_are_refused(name: str) -> None:
    with pytest.raises(DigsError, match=f"--{name.replace('_', '-')}: -1"):
        replace(SimulateConfig(), **{name: -1})


def test_settings_of_a_mesh_file_need_one() -> None:
    for settings in (
        SimulateConfig(object_size=0.3),
        SimulateConfig(up="z"),
        SimulateConfig(unit="mm"),
    ):
        with pytest.raises(DigsError, match="name a mesh"):
            load_inputs(settings)


def test_a_mistyped_path_does_not_claim_the_folder(config: SimulateConfig, tmp_path: Path) -> None:
    for wrong in ({"mesh": tmp_path / "none.glb"}, {"environment": tmp_path / "none.hdr"}):
        with pytest.raises(DigsError, match="no such file"):
            simulate(replace(config, **wrong), tmp_path / "capture")
    assert not (tmp_path / "capture").exists()
