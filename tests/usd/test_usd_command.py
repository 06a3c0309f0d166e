"""From the folder of a reconstruction to the package of its capture, by the commands that people use."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.testing import assert_allclose
from pxr import Usd, UsdGeom

from digs_warp.cli import EXIT_BAD_INPUT, EXIT_OK, EXIT_WRONG_USAGE, main
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.record.files import read_json, to_json
from digs_warp.record.run_log import RunLog
from digs_warp.usd.reader import read_scene
from digs_warp.usd.writer import write_gaussians
from reference.capture_scenes import splats
from reference.perturbed_poses import perturbed_poses
from reference.tiny_capture import write_tiny_capture
from reference.usd_files import Y_UP
from reference.usd_renderer import frustum_pixels


def test_a_reconstruction_becomes_a_scene_with_its_cameras(tmp_path: Path, capsys):
    capture = write_tiny_capture(tmp_path / "capture", frames=9)
    placement = ((0.0, 2.0, 0.0, 1.0), (-2.0, 0.0, 0.0, 2.0), (0.0, 0.0, 2.0, 3.0), (0, 0, 0, 1.0))
    index = read_json(capture.folder / "transforms.json", "index")
    index["digs_warp"]["world_from_mesh"] = placement
    (capture.folder / "transforms.json").write_text(to_json(index))
    folder, path = tmp_path / "reconstruction", tmp_path / "scene.usdz"
    recorded = [frame.camera.world_from_cam for frame in capture.frames]
    refined = [  # the last frame was not placed
        replace(frame, camera=replace(frame.camera, world_from_cam=pose))
        for frame, pose in zip(
            capture.frames[:8], perturbed_poses(recorded, 0.5, 0.005, seed=0), strict=False
        )
    ]
    held_out = tuple(frame for frame in refined if frame.name in ("0001", "0004", "0007"))
    training = tuple(frame for frame in refined if frame not in held_out)
    PosedFrames(training, held_out).save(folder)
    splats(30).save(folder / "gaussians.npz")
    RunLog("reconstruct", {"init": {"strategy": "depth"}}).save(folder / "run.json")
    arguments = ["export-usd", folder, "--capture", capture.folder, "--out", path]
    assert main([*map(str, arguments), "--precision", "mixed"]) == EXIT_OK

    scene = read_scene(path)
    assert (len(scene.gaussians), scene.metadata["kernel"]["dilation_px2"]) == (30, 0)
    assert_allclose(np.reshape(scene.metadata["world_from_mesh"], (4, 4)), placement)
    capsys.readouterr()
    assert main(["usd", "validate", str(path)]) == EXIT_OK
    assert "0 errors, 0 warnings in 3 combinations" in capsys.readouterr().out
    assert main(["info", str(path)]) == EXIT_OK
    out = capsys.readouterr().out
    for words in (
        *("30 at /Asset/Gaussians", "full, half, preview", "mixed", "degree 3"),
        *("/Asset/Rig/mono; 8 views", "Y up, 1 m per unit"),
    ):
        assert words in out
    stage = Usd.Stage.Open(str(path))
    rig = stage.GetPrimAtPath("/Asset/Rig")
    assert list(rig.GetCustomDataByKey("digs_warp:viewNames")) == [f.name for f in refined]
    assert list(rig.GetCustomDataByKey("digs_warp:heldOut")) == [i in (1, 4, 7) for i in range(8)]
    camera = UsdGeom.Camera(stage.GetPrimAtPath("/Asset/Rig/mono"))
    points = np.random.default_rng(0).normal(size=(20, 3)) * 0.1
    for i, frame in enumerate(refined):
        k = frame.camera.intrinsics
        project = frustum_pixels(camera.GetCamera(i), (k.width, k.height))
        assert_allclose(project(points @ Y_UP.T), frame.camera.project(points)[0], atol=1e-3)


def test_a_broken_scene_exits_with_1_and_its_report_is_not_replaced(tmp_path: Path, capsys):
    path, target = tmp_path / "broken.usda", tmp_path / "report.json"
    write_gaussians(path, splats(20), precision="mixed")
    path.write_text(path.read_text().replace("opacitiesh = [", "opacitiesh = [7, "))
    command = ["usd", "validate", str(path), "--json", str(target)]
    assert main(command) == EXIT_BAD_INPUT
    assert "21 values in 'opacities', expected 20" in capsys.readouterr().err
    report = json.loads(target.read_text())
    assert not report["ok"]
    assert {finding["rule"] for finding in report["findings"]} >= {"splat-count", "opacity-range"}
    assert main(command) == EXIT_BAD_INPUT
    assert "file exists" in capsys.readouterr().err
    assert main(["usd", "validate"]) == EXIT_WRONG_USAGE
