"""Captures as COLMAP models, read back by pycolmap: every pixel has to come out where it was."""

from pathlib import Path

import numpy as np
import pytest

from digs_warp.data.capture import Capture
from digs_warp.data.images import read_image
from digs_warp.device.libraries import import_pycolmap
from reference.exported import exported, true_points, zoomed
from reference.recorded import HEIGHT, WIDTH


@pytest.mark.parametrize("form", ["colmap", "colmap-binary"])
def test_pycolmap_sees_the_same_cameras(capture: Capture, form: str, tmp_path: Path) -> None:
    model = import_pycolmap().Reconstruction(exported(capture, form, tmp_path) / "sparse/0")
    assert model.num_cameras() == 1 and model.num_reg_images() == len(capture)
    points = np.random.default_rng(1).uniform(-0.3, 0.3, (20, 3))
    for frame in capture.frames:
        image = model.find_image_with_name(f"{frame.name}.png")
        expected, _ = frame.camera.project(points)
        found = np.array([image.project_point(point) for point in points])
        np.testing.assert_allclose(found, expected, atol=1e-9)
        (camera,) = model.cameras.values()
        assert (camera.width, camera.height) == (WIDTH, HEIGHT)


@pytest.mark.parametrize("form", ["colmap", "colmap-binary"])
def test_pycolmap_sees_the_depth_as_coloured_points(
    capture: Capture, form: str, tmp_path: Path
) -> None:
    model = import_pycolmap().Reconstruction(exported(capture, form, tmp_path) / "sparse/0")
    expected = np.concatenate([true_points(capture, number) for number in range(3)])
    colors = [f.load_image()[np.isfinite(f.load_depth())] for f in capture.frames]
    found = [model.points3D[key] for key in sorted(model.points3D)]
    np.testing.assert_allclose([point.xyz for point in found], expected, atol=1e-6)
    np.testing.assert_array_equal([point.color for point in found], np.concatenate(colors))


def test_colmap_text_and_binary_are_the_same_model(capture: Capture, tmp_path: Path) -> None:
    pycolmap = import_pycolmap()
    text = pycolmap.Reconstruction(exported(capture, "colmap", tmp_path / "a") / "sparse/0")
    binary = pycolmap.Reconstruction(
        exported(capture, "colmap-binary", tmp_path / "b") / "sparse/0"
    )
    for key, image in text.images.items():
        other = binary.images[key]
        assert image.name == other.name
        np.testing.assert_array_equal(
            image.cam_from_world().matrix(), other.cam_from_world().matrix()
        )
    np.testing.assert_array_equal(text.cameras[1].params, binary.cameras[1].params)


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


def test_points_of_large_recordings_are_thinned_evenly(
    capture: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("digs_warp.interchange.captures.colmap.MOST_POINTS", 60)
    model = import_pycolmap().Reconstruction(exported(capture, "colmap", tmp_path) / "sparse/0")
    assert 45 <= model.num_points3D() <= 60
