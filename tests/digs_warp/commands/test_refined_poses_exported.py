"""Refined poses leave the program: in the index and the models of other programs, and in USD scenes."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from digs_warp.cli import EXIT_OK, main
from digs_warp.data.capture import Capture
from digs_warp.data.images import read_image
from digs_warp.data.layers import Layer
from digs_warp.data.point_cloud import PointCloud
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.formats.captures.formats import read_recording
from digs_warp.record.layout import GAUSSIANS, INITIAL_POINTS
from digs_warp.record.run_log import RunLog
from reference.capture_scenes import splats
from reference.perturbed_poses import perturbed_poses
from reference.tiny_capture import write_tiny_capture
from reference.usd_files import Y_UP
from reference.usd_renderer import frustum_pixels

HELD_OUT = 4


@pytest.fixture(scope="module")
def work(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[np.ndarray], Capture]:
    """A recording, and a reconstruction of it with other poses and masks; the last frame was not placed."""
    folder = tmp_path_factory.mktemp("refined")
    capture = write_tiny_capture(folder / "capture", frames=9)
    recorded = [frame.camera.world_from_cam for frame in capture.frames]
    poses = perturbed_poses(recorded, 0.5, 0.005, seed=0)[:8]
    frames = [
        replace(
            frame.with_layer(Layer.MASK, np.full((54, 72), 255, np.uint8)),
            camera=replace(frame.camera, world_from_cam=pose),
        )
        for frame, pose in zip(capture.frames, poses, strict=False)
    ]
    held_out = frames[::HELD_OUT]
    training = [frame for i, frame in enumerate(frames) if i % HELD_OUT]
    result = folder / "reconstruction"
    PosedFrames(tuple(training), tuple(held_out)).save(result)
    splats(10).save(result / GAUSSIANS)
    PointCloud(np.zeros((10, 3)), np.zeros((10, 3))).save(result / INITIAL_POINTS)
    (result / "training.jsonl").write_text("")
    (result / "evaluation.json").write_text('{"mean": {}, "views": []}')
    RunLog("reconstruct", {}).save(result / "run.json")
    return folder, poses, capture


def test_an_export_of_a_reconstruction_has_its_poses_and_masks(
    work: tuple[Path, list[np.ndarray], Capture], tmp_path: Path
) -> None:
    folder, poses, _ = work
    for form in ["nerfstudio", "colmap", "tum"]:
        out = tmp_path / form
        line = ["convert", str(folder / "reconstruction"), "--to", form, "--out", str(out)]
        assert main(line) == EXIT_OK
        frames = read_recording(out, form).frames
        found = [frame.world_from_cam for frame in frames if frame.world_from_cam is not None]
        assert_allclose(np.stack(found), np.stack(poses), atol=1e-5)
        for mask in out.glob("masks/*"):
            assert read_image(mask, "mask").min() == 255
    index = json.loads((tmp_path / "nerfstudio/transforms.json").read_text())
    assert index["val_filenames"] == ["images/0000.png", "images/0004.png"]


def test_the_cameras_of_a_usd_scene_are_those_of_the_reconstruction(
    work: tuple[Path, list[np.ndarray], Capture], tmp_path: Path
) -> None:
    from pxr import Usd, UsdGeom

    folder, poses, capture = work
    path = tmp_path / "scene.usdz"
    line = ["export-usd", folder / "reconstruction", "--capture", capture.folder, "--out", path]
    assert main([str(word) for word in line]) == EXIT_OK
    stage = Usd.Stage.Open(str(path))
    camera = UsdGeom.Camera(stage.GetPrimAtPath("/Asset/Rig/mono"))
    points = np.random.default_rng(0).normal(size=(20, 3)) * 0.1
    for i, pose in enumerate(poses):
        used = replace(capture.frames[i].camera, world_from_cam=pose)
        project = frustum_pixels(
            camera.GetCamera(i), (used.intrinsics.width, used.intrinsics.height)
        )
        assert_allclose(project(points @ Y_UP.T), used.project(points)[0], atol=1e-3)
