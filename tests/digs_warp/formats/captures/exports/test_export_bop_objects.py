"""BOP data sets of several objects: every instance, with its pose, counts and model."""

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh

from digs_warp.checks import DigsError
from digs_warp.commands.convert import export_capture_folder
from digs_warp.data.images import read_image
from digs_warp.masks.config import SegmentConfig
from digs_warp.masks.masks import segment
from digs_warp.show.report.facts import describe
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.record import simulate
from reference.mesh_files import save


def test_every_instance_is_exported_with_its_model(tmp_path: Path) -> None:
    box = save(tmp_path / "box.ply", trimesh.creation.box((0.2, 0.1, 0.15)))
    rod = save(tmp_path / "rod.ply", trimesh.creation.box((0.05, 0.05, 0.3)))
    config = SimulateConfig(
        profile="bare-matcher", scene=(box, rod, box), frames=2, width=96, tier="truth", unit="m"
    )
    capture = simulate(config, tmp_path / "capture")
    export_capture_folder(tmp_path / "capture", "bop", tmp_path / "bop", overwrite=False)
    scene = tmp_path / "bop/train/000000"
    poses, infos, cameras = (
        json.loads((scene / f"{name}.json").read_text())
        for name in ("scene_gt", "scene_gt_info", "scene_camera")
    )
    sizes = json.loads((tmp_path / "bop/models/models_info.json").read_text())
    assert sizes.keys() == {"1", "2"}
    hidden = 0
    assert sizes["1"]["size_x"] == pytest.approx(200, abs=1e-3)
    for number, frame in enumerate(capture.frames):
        numbers = frame.load_instances()
        assert [pose["obj_id"] for pose in poses[str(number)]] == [1, 2, 1]
        k = np.array(cameras[str(number)]["cam_K"]).reshape(3, 3)
        for i, (pose, info) in enumerate(zip(poses[str(number)], infos[str(number)], strict=True)):
            seen = read_image(scene / f"mask_visib/{number:06d}_{i:06d}.png", "mask")[..., 0] > 0
            np.testing.assert_array_equal(seen, numbers == i + 1)
            view = frame.objects[i]
            assert info["px_count_visib"] == view.pixels_visible == seen.sum()
            assert info["px_count_all"] == view.pixels
            assert info["visib_fract"] == pytest.approx(view.visible_share)
            model = trimesh.load(
                tmp_path / f"bop/models/obj_{pose['obj_id']:06d}.ply", force="mesh"
            )
            assert isinstance(model, trimesh.Trimesh)
            turn = np.array(pose["cam_R_m2c"]).reshape(3, 3)
            points = (model.vertices @ turn.T + pose["cam_t_m2c"]) @ k.T
            pixels = points[:, :2] / points[:, 2:]  # BOP: 0 in the middle of the first pixel
            x, y, width, height = info["bbox_obj"]
            np.testing.assert_allclose(pixels.min(axis=0), (x, y), atol=1.1)
            np.testing.assert_allclose(pixels.max(axis=0), (x + width, y + height), atol=1.1)
            whole = read_image(scene / f"mask/{number:06d}_{i:06d}.png", "mask")[..., 0] > 0
            assert not (seen & ~whole).any()
            # The image holds all of it: what the masks show is what BOP's toolkit would count.
            assert whole.sum() == info["px_count_all"]
            rows, columns = np.nonzero(whole)
            assert (columns.min(), rows.min()) == (x, y)
            assert (np.ptp(columns), np.ptp(rows)) == (width, height)
            hidden += int((whole & ~seen).sum())
    assert hidden > 30
    assert describe(tmp_path / "capture")["objects"].startswith("1 box (")
    masks = segment(capture.frames, SegmentConfig(instance=2), tmp_path / "masks")
    for frame, path in zip(capture.frames, masks, strict=True):
        mask, inside = read_image(path, "mask")[..., 0], frame.load_instances() == 2
        np.testing.assert_array_equal(mask[inside], frame.load_mask()[inside])
        assert inside.any() and not mask[~inside].any()


def test_an_instance_needs_the_masks_of_the_recording() -> None:
    for settings in ({"masks": "depth", "instance": 1}, {"instance": 0}):
        with pytest.raises(DigsError, match="--instance"):
            SegmentConfig(**settings)  # pyright: ignore[reportArgumentType]
