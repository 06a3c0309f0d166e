"""Captures as BOP scenes, read back as the BOP toolkit reads them."""

import json
from pathlib import Path

import numpy as np
import pytest

from digs_warp.data.capture import Capture
from digs_warp.data.images import read_image
from digs_warp.formats.captures.bop import depth_scale
from digs_warp.geometry.rigid import rigid
from reference.exported import exported, points_as_integer_centered, true_points


def test_bop_puts_every_pixel_and_the_object_where_they_were(
    capture: Capture, tmp_path: Path
) -> None:
    """Read as the BOP toolkit reads: millimetres, row-wise matrices, integer pixel centers."""
    scene = exported(capture, "bop", tmp_path) / "train/000000"
    cameras = json.loads((scene / "scene_camera.json").read_text())
    objects = json.loads((scene / "scene_gt.json").read_text())
    assert list(cameras) == list(objects) == ["0", "1", "2"]
    for number, frame in enumerate(capture.frames):
        entry = cameras[str(number)]
        matrix = np.reshape(entry["cam_K"], (3, 3))
        depth = read_image(scene / f"depth/{number:06d}.png")[..., 0] * entry["depth_scale"]
        w2c = rigid(np.reshape(entry["cam_R_w2c"], (3, 3)), np.array(entry["cam_t_w2c"]))
        found = points_as_integer_centered(depth, matrix, np.linalg.inv(w2c))
        # Half a step of 0.1 mm.
        np.testing.assert_allclose(found / 1000.0, true_points(capture, number), atol=7.5e-5)
        (pose,) = objects[str(number)]
        model_origin_mm = np.array(pose["cam_t_m2c"])
        np.testing.assert_allclose(model_origin_mm, 1000 * frame.camera.cam_from_world[:3, 3])
        np.testing.assert_allclose(
            np.reshape(pose["cam_R_m2c"], (3, 3)), frame.camera.cam_from_world[:3, :3]
        )
        image = read_image(scene / f"rgb/{number:06d}.png")
        np.testing.assert_array_equal(image, frame.load_image())


def test_bop_describes_the_silhouettes(capture: Capture, tmp_path: Path) -> None:
    scene = exported(capture, "bop", tmp_path) / "train/000000"
    infos = json.loads((scene / "scene_gt_info.json").read_text())
    for number, frame in enumerate(capture.frames):
        (info,) = infos[str(number)]
        mask = read_image(scene / f"mask_visib/{number:06d}_000000.png")[..., 0] == 255
        np.testing.assert_array_equal(mask, frame.load_mask() > 127)
        known = np.isfinite(frame.load_depth())
        assert info["px_count_visib"] == info["px_count_all"] == mask.sum() > 30
        assert info["px_count_valid"] == (mask & known).sum() < mask.sum()
        x, y, width, height = info["bbox_visib"]
        box = np.zeros_like(mask)
        box[y : y + height + 1, x : x + width + 1] = True
        assert not (mask & ~box).any()
        edges = (mask[y], mask[y + height], mask[:, x], mask[:, x + width])
        assert all(edge.any() for edge in edges)


@pytest.mark.parametrize(
    ("farthest", "scale"), [(0.5, 0.1), (6.5534, 0.1), (6.56, 0.2), (32.0, 0.5), (99.0, 1.0)]
)
def test_bop_takes_the_finest_depth_scale_that_fits(farthest: float, scale: float) -> None:
    depth = np.array([[np.nan, 0.4, farthest]])
    assert depth_scale(depth) == scale
