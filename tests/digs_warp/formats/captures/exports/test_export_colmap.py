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
from digs_warp.init.recipes import initialize
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
    expected = initialize(ball.split()[0], InitConfig()).points
    found = [model.points3D[key] for key in sorted(model.points3D)]
    np.testing.assert_allclose([p.xyz for p in found], expected.points_world, atol=1e-7)
    np.testing.assert_allclose([p.color for p in found], 255 * expected.colors, atol=0.5001)
    radii = np.linalg.norm([p.xyz for p in found], axis=1)
    assert len(found) > 1000 and abs(radii - RADIUS).max() < 0.01


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
    points = initialize(ball.split()[0], InitConfig()).points
    flat = replace(flat, points=points if has_points else None)
    model = import_pycolmap().Reconstruction(exported(flat, "colmap", tmp_path / "a") / "sparse/0")
    count = len(points) if has_points else 0
    assert (model.num_points3D(), model.num_reg_images()) == (count, 10)
    assert (exported(flat, "nerfstudio", tmp_path / "b") / "sparse_pc.ply").is_file() == has_points


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
