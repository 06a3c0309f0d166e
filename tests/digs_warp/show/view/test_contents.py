"""What a page shows of each kind of file and folder."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.geometry.sh import C0
from digs_warp.show.view.contents import NAME, Contents, Stage, read_contents, sensed_points
from digs_warp.show.view.layers import load_picture, pictures_of, points_as_splats
from digs_warp.train.training import save_snapshot
from reference.report_folder import write_capture, write_reconstruction
from reference.tiny_capture import ball


@pytest.fixture
def capture(tmp_path: Path) -> Capture:
    return write_capture(tmp_path / "capture")


def test_a_capture_has_its_views_and_its_depth_as_points_of_its_colors(capture: Capture) -> None:
    contents = read_contents(capture.folder)
    assert (contents.name, len(contents.frames), contents.stages) == ("capture", len(capture), ())
    cloud = contents.points[NAME]
    # Depth of 1 to 1.3 m on the disc and 4 m around it, seen from a circle of 1 m.
    assert len(cloud) > 1000
    away = np.linalg.norm(cloud.points_world - [0, 0, 0.3], axis=1)
    assert 0 < away.min() and away.max() < 6
    frame = capture.frames[0]
    one = sensed_points([frame])[NAME]
    columns, rows = frame.camera.project(one.points_world.astype(np.float64))[0].astype(int).T
    np.testing.assert_allclose(one.colors, frame.load_image()[rows, columns] / 255, atol=1e-6)
    points = points_as_splats(cloud, 2.0)
    np.testing.assert_allclose(0.5 + C0 * points.sh[:, 0], cloud.colors, atol=1e-6)
    np.testing.assert_allclose(points.scales, 0.006, rtol=1e-5)


def test_a_reconstruction_has_its_start_and_every_snapshot(
    capture: Capture, tmp_path: Path
) -> None:
    folder = tmp_path / "reconstruction"
    write_reconstruction(folder, capture)
    for iteration in (0, 100):
        save_snapshot(folder, iteration, ball())
    contents = read_contents(folder)
    assert [stage.label for stage in contents.stages] == ["iteration 0", "iteration 100", "result"]
    assert "start" in contents.points
    assert NAME in contents.points
    assert len(contents.frames) == len(capture)
    assert contents.name == tmp_path.name  # of the run, not 'reconstruction'
    assert any("dB" in fact for fact in contents.facts)


def test_what_cannot_be_shown_is_told(tmp_path: Path) -> None:
    with pytest.raises(DigsError, match="no such file or folder"):
        read_contents(tmp_path / "nothing")
    (tmp_path / "notes.txt").write_text("hello")
    with pytest.raises(DigsError, match=r"notes\.txt"):
        read_contents(tmp_path / "notes.txt")
    ball().select(slice(0, 0)).save(tmp_path / "empty.npz")
    with pytest.raises(DigsError, match="0 Gaussians"):
        read_contents(tmp_path / "empty.npz")


def test_the_pictures_in_the_cameras(capture: Capture) -> None:
    frames = tuple(capture.frames)
    assert pictures_of(frames) == ["photograph", "measured depth"]
    photo = load_picture(frames[0], "photograph")
    depth = load_picture(frames[0], "measured depth")
    assert photo is not None and depth is not None
    assert np.array_equal(photo, frames[0].load_image())
    assert (depth[:, :5] == 128).all()  # nothing was measured there
    assert (depth[:, 5:] != 128).any(axis=-1).all()
    assert load_picture(frames[0], "why depth is missing") is None


def test_the_view_begins_where_all_is_seen(capture: Capture) -> None:
    moved = replace(ball(), means=ball().means + np.array([5.0, 0.0, 0.0], np.float32))
    first = Contents("a", stages=(Stage("result", moved),)).first_view()
    px, depth = first.camera.project(moved.means.astype(np.float64))
    k = first.camera.intrinsics
    assert (depth > 0).all() and ((px >= 0) & (px <= [k.width, k.height])).all()
    frames = tuple(capture.frames)  # an object is seen from the side that was recorded first
    side = Contents("b", stages=(Stage("result", ball()),), frames=frames).first_view()
    assert (side.camera.center_world - side.target) @ frames[0].camera.center_world > 0.5
    recorded = read_contents(capture.folder).first_view()  # nothing says what the object is
    pose = capture.frames[0].camera.world_from_cam
    np.testing.assert_array_equal(recorded.camera.world_from_cam, pose)
