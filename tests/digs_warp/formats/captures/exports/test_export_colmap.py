"""Captures as COLMAP models, read back by pycolmap and by the rules of OpenSplat."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.data.capture import Capture
from digs_warp.data.images import read_image
from digs_warp.data.layers import Layer
from digs_warp.device.libraries import import_pycolmap
from digs_warp.formats.captures.formats import export_capture
from digs_warp.init.config import InitConfig
from digs_warp.init.recipes import initial_points
from reference.exported import exported, zoomed
from reference.tiny_capture import RADIUS, write_tiny_capture


@pytest.fixture(scope="module")
def ball(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    """A capture with a surface, from which depth makes points."""
    return write_tiny_capture(tmp_path_factory.mktemp("ball") / "capture", frames=10)


@pytest.mark.parametrize("form", ["colmap", "colmap-text"])
def test_the_points_are_those_that_our_own_start_takes(
    ball: Capture, form: str, tmp_path: Path
) -> None:
    """Of the object, of the training frames, one per voxel."""
    model = import_pycolmap().Reconstruction(exported(ball, form, tmp_path) / "sparse/0")
    expected = initial_points(ball.split()[0], InitConfig())
    found = [model.points3D[key] for key in sorted(model.points3D)]
    np.testing.assert_allclose([p.xyz for p in found], expected.points_world, atol=1e-7)
    np.testing.assert_allclose([p.color for p in found], 255 * expected.colors, atol=0.5001)
    radii = np.linalg.norm([p.xyz for p in found], axis=1)
    assert len(found) > 1000 and abs(radii - RADIUS).max() < 0.01


@pytest.mark.parametrize("form", ["colmap", "colmap-text"])
def test_tracks_name_training_images_that_show_the_point(
    ball: Capture, form: str, tmp_path: Path
) -> None:
    model = import_pycolmap().Reconstruction(exported(ball, form, tmp_path) / "sparse/0")
    names = {frame.name for frame in ball.split()[0]}
    lengths = []
    for number, point in model.points3D.items():
        lengths.append(point.track.length())
        for element in point.track.elements:
            image = model.images[element.image_id]
            assert Path(image.name).stem in names
            seen = image.points2D[element.point2D_idx]
            assert seen.point3D_id == number
            projected = image.project_point(point.xyz)
            assert projected is not None and (projected > 0).all()
            np.testing.assert_allclose(seen.xy, projected, atol=1e-6)
    assert 3 <= np.median(lengths) < len(names)  # no camera sees through the ball
    assert model.compute_mean_reprojection_error() < 1e-6
    observed = {Path(image.name).stem for image in model.images.values() if image.num_points3D}
    assert observed == names


@pytest.mark.parametrize("has_points", [False, True])
def test_a_capture_without_depth_keeps_its_points(
    ball: Capture, tmp_path: Path, has_points: bool
) -> None:
    flat = replace(
        ball,
        frames=tuple(
            replace(frame, layers={Layer.IMAGE: frame.layers[Layer.IMAGE]}) for frame in ball.frames
        ),
    )
    points = initial_points(ball.split()[0], InitConfig())
    flat = replace(flat, points=points if has_points else None)
    model = import_pycolmap().Reconstruction(exported(flat, "colmap", tmp_path / "a") / "sparse/0")
    count = len(points) if has_points else 0
    assert (model.num_points3D(), model.num_reg_images()) == (count, 10)
    assert (exported(flat, "nerfstudio", tmp_path / "b") / "sparse_pc.ply").is_file() == has_points
    if has_points:  # a camera sees a part of the ball, and not through it
        shares = [image.num_points3D / count for image in model.images.values()]
        assert 0.2 < max(shares) < 0.8


def test_masks_without_the_object_are_a_warning(
    ball: Capture, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    empty = np.zeros_like(ball.frames[0].load_mask())
    frames = tuple(frame.with_layer(Layer.MASK, empty) for frame in ball.frames)
    export_capture(replace(ball, frames=frames), "colmap", tmp_path)
    assert "exported without points to start from: initialization: no points in 8" in caplog.text


def test_colmap_keeps_a_camera_per_frame(capture: Capture, tmp_path: Path) -> None:
    folder = exported(zoomed(capture), "colmap", tmp_path)
    model = import_pycolmap().Reconstruction(folder / "sparse/0")
    focal = [model.images[i].camera.params[0] for i in (1, 2, 3)]
    assert focal == [19.0, 19.0, 30.0]


def test_colmap_masks_stand_beside_their_images(capture: Capture, tmp_path: Path) -> None:
    folder = exported(capture, "colmap", tmp_path)
    for frame in capture.frames:
        mask = read_image(folder / f"masks/{frame.name}.png.png")[..., 0]
        np.testing.assert_array_equal(mask == 255, frame.load_mask() > 127)
        assert set(np.unique(mask)) == {0, 255}
