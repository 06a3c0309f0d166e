"""Real recordings: each reader gets the layout it expects, and what fails is a row with its error."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.capture import read_capture
from digs_warp.data.images import encode_jpeg
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.formats.captures.formats import export_capture, read_recording
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.record import simulate
from studies import recordings as bench
from studies.benchmarks import find_benchmark
from studies.real_recordings import (
    DOOR_REDUCTION,
    RECORDINGS,
    RealRecording,
    find_recordings,
    smaller_door,
)

STEPS = 10
LAYOUTS = {"hololens_room_sequence": 24, "tum_cabinet_orbit": 29, "zed2i_stereo_pair": 1}


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Sample data with a tiny recording in TUM's format, and one that is none."""
    folder = tmp_path_factory.mktemp("data")
    recording = SimulateConfig(frames=10, width=64, samples_per_pixel=1, tier="law")
    capture = simulate(recording, folder / "capture")
    export_capture(capture, "tum", folder / "rgbd/orbit")
    (folder / "rgbd/broken").mkdir()
    return folder


@pytest.fixture(scope="module")
def measured(data: Path) -> list[bench.Measured]:
    recordings = [RealRecording("broken", "tum"), RealRecording("orbit", "tum")]
    return list(bench.measure_all(recordings, data, STEPS))


def test_recorded_poses_give_all_figures_and_two_views(measured: list[bench.Measured]) -> None:
    rows = {
        row.labels["poses"]: row.values for row in measured[1].results if row.table == bench.FIGURES
    }
    assert tuple(rows) == ("recorded", "estimated", "color and depth")
    values = rows["recorded"]
    assert values["frames"] == 10 and values["held out"] == 2
    assert values["PSNR [dB]"] > 8 and values["exposure of neighbors [dB]"] > 8
    assert values["Gaussians"] > 100
    assert 0 < values["depth error [cm]"] < 30  # barely trained
    picture = measured[1].picture
    assert picture is not None and picture.shape == (2 * 36, 2 * 64, 3)


def test_poses_are_compared_up_to_a_similarity(data: Path) -> None:
    capture = read_capture(data / "capture")
    frames = PosedFrames.as_recorded(capture)
    bigger = frames.in_metres(0.5)  # a wrong scale, which an alignment takes away
    assert bench.pose_error(bigger, capture)["pose error [cm]"] < 1e-9
    turn = np.diag([-1.0, -1.0, 1.0, 1.0])
    turned = tuple(
        replace(f, camera=replace(f.camera, world_from_cam=f.camera.world_from_cam @ turn))
        for f in frames.training
    )
    errors = bench.pose_error(replace(frames, training=turned), capture)
    assert errors["pose error [deg]"] == pytest.approx(180, abs=1e-3)
    assert errors["pose error [cm]"] < 1e-9


def test_a_failure_is_a_row_with_its_error_and_the_others_are_measured(
    measured: list[bench.Measured],
) -> None:
    (row,) = measured[0].results
    assert measured[1].results[0].labels["stage"] == "check"
    assert row.table == bench.FINDINGS and row.labels["stage"] == "conversion"
    assert "no rgb.txt" in row.labels["what was found"]
    # 64 pixels are too few to match images.
    failed = [
        row.labels["what was found"]
        for row in measured[1].results
        if row.labels.get("stage") == "estimated poses"
    ]
    assert len(failed) == 1 and "structure from motion" in failed[0]
    assert "/tmp" not in failed[0]


def test_the_figures_come_before_the_findings(measured: list[bench.Measured]) -> None:
    tables = [row.table for row in bench.rows(measured)]
    assert tables == sorted(tables) and set(tables) == {bench.FIGURES, bench.FINDINGS}


def test_the_command_knows_the_recordings() -> None:
    assert find_benchmark("recordings").cases == tuple(each.name for each in RECORDINGS)


def test_no_or_unknown_recordings_are_named(tmp_path: Path) -> None:
    with pytest.raises(DigsError, match=r"no hololens_room_sequence and .*DIGS_WARP_SAMPLE_DATA"):
        find_recordings(tmp_path)
    with pytest.raises(DigsError, match=r"did you mean 'tum_cabinet_orbit'"):
        find_recordings(tmp_path, ["tum_cabinet"])
    (tmp_path / "rgbd/tum_cabinet_orbit").mkdir(parents=True)
    (found,) = find_recordings(tmp_path)
    assert found.name == "tum_cabinet_orbit"
    with pytest.raises(DigsError, match="has no lund_door_photos;"):
        find_recordings(tmp_path, ["tum_cabinet_orbit", "lund_door_photos"])


@pytest.mark.parametrize(("name", "frames"), LAYOUTS.items())
def test_readers_take_the_layouts(
    sample_data: Path, tmp_path: Path, name: str, frames: int
) -> None:
    source = sample_data / "rgbd" / name
    if not source.is_dir():
        pytest.skip(f"no {name} in the sample data")
    known = next(each for each in RECORDINGS if each.name == name)
    recording = read_recording(known.arrange(source, tmp_path), known.form)
    assert len(recording.frames) == frames
    assert recording.knows_poses == known.has_poses
    assert known.has_poses == all(frame.depth is not None for frame in recording.frames)


def test_a_door_is_reduced_with_its_camera(tmp_path: Path) -> None:
    source, model = tmp_path / "door", tmp_path / "door/colmap_ground_truth"
    model.mkdir(parents=True)
    size = 10 * DOOR_REDUCTION
    pixels = np.full((size, 2 * size, 3), 77, np.uint8)
    (source / "images").mkdir()
    (source / "images/a.JPG").write_bytes(encode_jpeg(pixels))
    (model / "cameras.txt").write_text(f"# one\n1 SIMPLE_RADIAL {2 * size} {size} 90 30 15 -0.1\n")
    (model / "images.txt").write_text("1 1 0 0 0 0 0 0 1 a.JPG\n\n")
    (model / "points3D.txt").write_text("")
    (frame,) = read_recording(smaller_door(source, tmp_path / "small"), "colmap").frames
    camera = frame.file_camera
    assert (camera.width, camera.height) == (20, 10)
    assert (camera.fx, camera.cx, camera.cy) == (30, 10, 5)
    assert frame.view is not None and frame.view.lens is not None
    assert frame.view.lens.coefficients[0] == pytest.approx(-0.1)
