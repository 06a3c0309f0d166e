"""From the folders of a reconstruction to the package of its capture, by the command."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from digs_warp.cli import EXIT_OK, EXIT_WRONG_USAGE, main
from digs_warp.data.capture import Capture
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.record.files import read_json, to_json
from digs_warp.record.run_log import RunLog
from digs_warp.usd.reader import read_scene
from digs_warp.usd.validate import validate
from reference.capture_scenes import cloud, splats
from reference.tiny_capture import write_tiny_capture
from reference.usd_files import Y_UP
from reference.usd_renderer import frustum_pixels


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    return write_tiny_capture(tmp_path_factory.mktemp("work") / "capture", frames=9)


def reconstruction(capture: Capture, name: str, strategy: str, count: int) -> Path:
    """A folder as a finished reconstruction leaves it."""
    folder = capture.folder.parent / name
    training, held_out = capture.split(4)
    PosedFrames(tuple(training), tuple(held_out)).save(folder)
    splats(count).save(folder / "gaussians.npz")
    cloud(count).save(folder / "initial_points.npz")
    RunLog("reconstruct", {"init": {"strategy": strategy}}).save(folder / "run.json")
    return folder


def test_reconstructions_of_one_capture_become_variants_with_its_cameras(
    capture: Capture, tmp_path: Path
):
    from pxr import Usd, UsdGeom

    first = reconstruction(capture, "a", "depth", 30)
    second = reconstruction(capture, "b", "random", 20)
    path = tmp_path / "scene.usdz"
    arguments = ["export-usd", first, "--capture", capture.folder, "--also", second, "--out", path]
    assert main([*map(str, arguments), "--precision", "mixed", "--sh-degree", "1"]) == EXIT_OK
    for variant, count in (("depth", 30), ("random", 20)):
        scene = read_scene(path, variants={"init": variant})
        assert len(scene.gaussians) == count
        assert scene.gaussians.sh_degree == 1
    assert scene.metadata["kernel"]["dilation_px2"] == 0
    assert validate(path).findings == ()
    stage = Usd.Stage.Open(str(path))
    rig = stage.GetPrimAtPath("/Asset/Rig")
    assert list(rig.GetCustomDataByKey("digs_warp:viewNames")) == [f.name for f in capture.frames]
    assert list(rig.GetCustomDataByKey("digs_warp:heldOut")) == [i in (1, 4, 7) for i in range(9)]
    camera = UsdGeom.Camera(stage.GetPrimAtPath("/Asset/Rig/mono"))
    points = np.random.default_rng(0).normal(size=(20, 3)) * 0.1
    for i, frame in enumerate(capture.frames):
        k = frame.camera.intrinsics
        project = frustum_pixels(camera.GetCamera(i), (k.width, k.height))
        assert_allclose(project(points @ Y_UP.T), frame.camera.project(points)[0], atol=1e-3)


def test_same_strategies_are_numbered(capture: Capture, tmp_path: Path):
    folders = [reconstruction(capture, name, "depth", 5) for name in ("c", "d")]
    path = tmp_path / "scene.usdz"
    arguments = ["export-usd", folders[0], "--capture", capture.folder, "--also", folders[1]]
    assert main([*map(str, arguments), "--out", str(path)]) == EXIT_OK
    for variant in ("depth_1", "depth_2"):
        read_scene(path, variants={"init": variant})


def test_variants_need_the_capture(tmp_path: Path):
    arguments = ["export-usd", "a", "--also", "b", "--out", str(tmp_path / "scene.usdz")]
    assert main(arguments) == EXIT_WRONG_USAGE


def test_the_scene_says_where_the_mesh_file_stands(tmp_path: Path):
    placement = ((0.0, 2.0, 0.0, 1.0), (-2.0, 0.0, 0.0, 2.0), (0.0, 0.0, 2.0, 3.0), (0, 0, 0, 1.0))
    capture = write_tiny_capture(tmp_path / "capture", frames=9)
    index = read_json(capture.folder / "transforms.json", "index")
    index["digs_warp"]["world_from_mesh"] = placement
    (capture.folder / "transforms.json").write_text(to_json(index))
    folder = reconstruction(capture, "f", "depth", 5)
    arguments = [
        "export-usd",
        folder,
        "--capture",
        capture.folder,
        "--out",
        tmp_path / "scene.usdz",
    ]
    assert main([*map(str, arguments)]) == EXIT_OK
    metadata = read_scene(tmp_path / "scene.usdz").metadata
    assert_allclose(np.reshape(metadata["world_from_mesh"], (4, 4)), placement)
