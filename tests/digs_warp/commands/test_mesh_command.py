"""`digs-warp mesh`: from a simulated capture to a mesh that is held against the recorded one."""

import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.cli import EXIT_BAD_INPUT, EXIT_OK, EXIT_WRONG_USAGE, main
from digs_warp.data.capture_writer import CaptureWriter, FrameImages
from digs_warp.data.gaussians import Gaussians
from digs_warp.geometry.camera import Intrinsics
from digs_warp.geometry.sh import sh_from_rgb
from digs_warp.measure.surface_metrics import sample_surface
from digs_warp.show.film.camera_path import Subject, orbit
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.record import simulate
from digs_warp.splat.config import REACH
from digs_warp.surface.true_surface import read_true_surface
from reference.optional import open3d_or_skip
from reference.tiny_capture import ball, write_tiny_capture


@pytest.fixture(autouse=True)
def open3d() -> None:
    open3d_or_skip()


@pytest.fixture(scope="module")
def built_in(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run: cameras all around the built-in object, Gaussians that lie on its surface.

    The record is that of a real recording, its frames are too few and small to see the whole object.
    """
    folder = tmp_path_factory.mktemp("run")
    config = SimulateConfig(
        profile="bare-matcher", frames=1, width=32, height=18, samples_per_pixel=1, tier="law"
    )
    simulate(config, folder / "recording")
    surface = read_true_surface(folder / "recording")
    assert surface is not None
    k = Intrinsics.from_fov(160, 160, 40.0)
    writer = CaptureWriter(folder / "capture", k)
    gray = np.full((160, 160, 3), 128, np.uint8)
    nothing = np.full((160, 160), np.nan, np.float32)
    everything = np.full((160, 160), 255, np.uint8)
    subject = Subject(np.zeros(3), 0.28)
    rings = [camera for elevation in (-40, 0, 40, 75) for camera in orbit(subject, k, 8, elevation)]
    for number, camera in enumerate(rings):
        writer.write_frame(number, FrameImages(gray, nothing, everything))
        writer.add_pose(number, camera.world_from_cam, 0.1 * number)
    writer.finish()
    shutil.copy(folder / "recording/run.json", folder / "capture/run.json")
    deviation, opacity_logit = 0.003, 3.0
    skin = REACH * deviation  # what lies on the surface
    inner = replace(surface, points_world=surface.points_world - skin * surface.normals())
    points = sample_surface(inner, 20_000)
    Gaussians(
        means=points,
        log_scales=np.full((len(points), 3), np.log(deviation)),
        quats=np.tile([0.0, 0.0, 0.0, 1.0], (len(points), 1)),
        opacity_logits=np.full(len(points), opacity_logit),
        sh=sh_from_rgb(np.full((len(points), 1, 3), 0.6)),
    ).save(folder / "reconstruction/gaussians.npz")
    return folder


def distances_mm(text: str) -> tuple[float, float]:
    """Chamfer distance, and the part of it from the mesh to the truth."""
    found = re.search(r"recorded mesh ([\d.]+) mm \(mesh to truth ([\d.]+) mm", text)
    assert found, text
    return float(found[1]), float(found[2])


def test_the_mesh_of_the_built_in_object_lies_on_it(built_in: Path, tmp_path: Path, run) -> None:
    code, text = run("mesh", built_in, "--out", tmp_path / "a.glb", "--voxel-size", 0.006)
    assert code == EXIT_OK, text
    assert "32 views, voxels of 6.00 mm" in text
    chamfer, to_truth = distances_mm(text)
    assert to_truth < 6.0
    assert chamfer < 3 * 6.0  # nobody sees the inside
    assert "floaters" in text
    assert run("mesh", built_in, "--out", tmp_path / "a.glb")[0] == EXIT_BAD_INPUT
    # The comparison is with the object where the capture put it: 3 cm off shows.
    gaussians = Gaussians.load(built_in / "reconstruction/gaussians.npz")
    gaussians.means[:, 2] += 0.03
    gaussians.save(tmp_path / "moved.npz")
    arguments = [tmp_path / "moved.npz", "--capture", built_in / "capture", "--voxel-size", 0.006]
    code, text = run("mesh", *arguments, "--out", tmp_path / "b.glb")
    assert code == EXIT_OK and distances_mm(text)[1] > 9, text


def test_a_recording_of_something_real_is_compared_with_nothing(tmp_path: Path, run) -> None:
    write_tiny_capture(tmp_path / "capture", frames=8)
    ball(3000).save(tmp_path / "reconstruction/gaussians.npz")
    code, text = run(
        "mesh", tmp_path / "reconstruction", "--out", tmp_path / "a.ply", "--voxel-size", 0.02
    )
    assert code == EXIT_OK, text
    assert "8 views" in text
    assert "the photographs doubt the measured depth" in text
    assert "Chamfer" not in text


def test_what_cannot_be_done_is_said(tmp_path: Path, monkeypatch, run) -> None:
    for arguments, code, message in [
        (["--out", "a.obj"], EXIT_BAD_INPUT, "expected .glb or .ply"),
        (["--out", "a.glb", "--capture", "none"], EXIT_BAD_INPUT, "no such folder"),
        (["--out", "a.glb", "--voxel-size", "0"], EXIT_WRONG_USAGE, "--voxel"),
        (["--out", "a.glb", "--views", "2"], EXIT_WRONG_USAGE, "--views: 2, expected 3 to"),
        (["--out", "a.glb", "--voxel-size", "1e-6"], EXIT_BAD_INPUT, "use at least"),
    ]:
        monkeypatch.chdir(tmp_path)
        ball(50).save(tmp_path / "a.npz")
        found, text = run("mesh", "a.npz", *arguments)
        assert (found, message in text) == (code, True), text
        assert [p.name for p in tmp_path.iterdir()] == ["a.npz"]


def test_the_mesh_goes_into_the_usd_scene(built_in: Path, tmp_path: Path, capsys) -> None:
    from pxr import Usd, UsdGeom  # pyright: ignore

    target = tmp_path / "a.usdz"
    arguments = [str(built_in / "reconstruction"), "--out", str(target), "--surface"]
    assert main(["export-usd", *arguments]) == EXIT_WRONG_USAGE
    assert "--surface needs --capture" in capsys.readouterr().err
    assert main(["export-usd", *arguments, "--capture", str(built_in / "capture")]) == EXIT_OK
    stage = Usd.Stage.Open(str(target))
    meshes = {p.GetName(): UsdGeom.Mesh(p) for p in stage.Traverse() if p.IsA(UsdGeom.Mesh)}
    extracted = np.array(meshes["Surface"].GetPointsAttr().Get())
    recorded = np.array(meshes["Mesh"].GetPointsAttr().Get())
    np.testing.assert_allclose(extracted.min(axis=0), recorded.min(axis=0), atol=0.02)
    np.testing.assert_allclose(extracted.max(axis=0), recorded.max(axis=0), atol=0.02)
