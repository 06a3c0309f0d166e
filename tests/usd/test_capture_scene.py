"""The package of a capture: levels of detail, meshes, cameras, an independent renderer, the commands."""

import json
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pxr import Usd, UsdGeom
from scipy.spatial import KDTree

from digs_warp.checks import UsdError
from digs_warp.cli import EXIT_BAD_INPUT, EXIT_OK, EXIT_WRONG_USAGE, main
from digs_warp.data.gaussians import FIELDS
from digs_warp.data.images import linear_from_srgb
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.geometry.rigid import matrix_from_quat_xyzw
from digs_warp.record.files import read_json, to_json
from digs_warp.record.run_log import RunLog
from digs_warp.splat.render import render
from digs_warp.usd.capture_scene import CaptureScene, write_capture_scene
from digs_warp.usd.convert import Precision
from digs_warp.usd.lod import (
    KEPT_BEFORE_MERGING,
    LEVELS,
    MERGED_WIDENING,
    level_of_detail,
    merged_in_voxels,
)
from digs_warp.usd.reader import read_scene
from digs_warp.usd.writer import write_gaussians
from reference.capture_scenes import BASELINE, camera_path, full_scene, splats, tetrahedron
from reference.perturbed_poses import perturbed_poses
from reference.tiny_capture import write_tiny_capture
from reference.usd_files import Y_UP, covariances
from reference.usd_renderer import frustum_pixels, render_usd


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("capture") / "scene.usdz"
    write_capture_scene(path, full_scene())
    return path


def open_stage(path: Path):
    return Usd.Stage.Open(str(path))


def test_one_field_is_shown_and_variants_hold_its_levels(package: Path, tmp_path: Path):
    stage = open_stage(package)
    fields = [p for p in stage.Traverse() if p.GetTypeName() == "ParticleField3DGaussianSplat"]
    assert [str(prim.GetPath()) for prim in fields] == ["/Asset/Gaussians"]
    assert len(fields[0].GetAttribute("positions").Get()) == 40
    for level, share in LEVELS.items():
        scene = tmp_path / f"{level}.usda"
        choice = f'references = @{package}@\nvariants = {{ string lod = "{level}" }}'
        scene.write_text(
            f'#usda 1.0\n(upAxis = "Y"\n metersPerUnit = 1)\ndef "Asset" ({choice})\n{{\n}}\n'
        )
        read = read_scene(scene).gaussians
        expected = level_of_detail(full_scene().gaussians, share)
        assert_array_equal(read.means, expected.means)
        assert_allclose(read.log_scales, expected.log_scales, atol=1e-6)


@pytest.mark.parametrize("name", ["Mesh", "Surface"])
def test_meshes_are_guides_in_the_frame_of_the_asset(package: Path, name: str):
    stage = open_stage(package)
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath(f"/Asset/Source/{name}"))
    assert mesh.GetPurposeAttr().Get() == "guide"
    corners = np.array(mesh.GetPointsAttr().Get())
    assert_allclose(corners, tetrahedron().points_world @ Y_UP.T, atol=1e-9)
    normals = np.array(mesh.GetNormalsAttr().Get())
    assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-6)
    # Outwards: counter-clockwise triangles of a convex body.
    assert (((corners - corners.mean(axis=0)) * normals).sum(axis=1) > 0).all()
    indices = np.array(mesh.GetFaceVertexIndicesAttr().Get())
    assert_array_equal(indices, tetrahedron().triangles.reshape(-1))
    shown = np.array(mesh.GetDisplayColorPrimvar().Get())
    assert_allclose(shown, linear_from_srgb(tetrahedron().colors), atol=1e-6)


def test_usd_cameras_see_every_point_where_ours_do(tmp_path: Path):
    views = camera_path(zoom=3.0)
    path = tmp_path / "scene.usdz"
    write_capture_scene(path, CaptureScene(splats(5), cameras=views))
    stage = open_stage(path)
    points = np.random.default_rng(0).uniform(-0.2, 0.2, (200, 3))
    # The corners of the box of all ellipsoids, in the world.
    box = np.array(stage.GetPrimAtPath("/Asset/Gaussians").GetAttribute("extent").Get())
    points[:8] = [*product(*box.T)] @ Y_UP
    for role, shift in (("left", 0.0), ("right", BASELINE)):
        camera = UsdGeom.Camera(stage.GetPrimAtPath(f"/Asset/Rig/{role}"))
        assert camera.GetStereoRoleAttr().Get() == role
        for i, view in enumerate(views.cameras):
            px, depth = view.shifted_right(shift).project(points)
            project = frustum_pixels(camera.GetCamera(i), views.image_size)
            assert np.abs(project(points @ Y_UP.T) - px).max() < 1e-3
            near, far = camera.GetClippingRangeAttr().Get()
            assert near < depth.min() < depth.max() < far


def test_the_timeline_is_the_recording_and_turns_along_the_shorter_arc(package: Path):
    stage = open_stage(package)
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (0, 8)
    assert stage.GetTimeCodesPerSecond() == 4.0
    rig = stage.GetPrimAtPath("/Asset/Rig")
    assert list(rig.GetCustomDataByKey("digs_warp:viewTimes")) == list(camera_path().times)
    assert list(rig.GetCustomDataByKey("digs_warp:heldOut")) == list(camera_path().held_out)
    size = stage.GetPrimAtPath("/Render/left").GetAttribute("resolution").Get()
    assert tuple(size) == (88, 66)
    place = UsdGeom.Xformable(rig).GetLocalTransformation
    for i in range(8):
        before, between, after = (np.array(place(i + t))[2, :3] for t in (0, 0.5, 1))
        assert between @ before > 0.5 + 0.5 * (before @ after) - 1e-6
    # Also for programs that interpolate the four numbers.
    quats = [rig.GetAttribute("xformOp:orient").Get(i) for i in range(9)]
    numbers = np.array([[q.GetReal(), *q.GetImaginary()] for q in quats])
    assert ((numbers[1:] * numbers[:-1]).sum(axis=1) > 0).all()


@pytest.mark.parametrize(("role", "precision"), [("left", "float"), ("right", "mixed")])
def test_an_independent_renderer_draws_the_file_as_ours_draws_the_gaussians(
    tmp_path: Path, role: str, precision: Precision
):
    scene = full_scene(120)
    path = tmp_path / "scene.usdz"
    write_capture_scene(path, scene, precision)
    background = (0.2, 0.5, 0.9)
    assert scene.cameras
    for view in (0, 5):
        camera = scene.cameras.cameras[view].shifted_right(BASELINE if role == "right" else 0.0)
        ours = render(scene.gaussians, camera, background=background)
        drawn = render_usd(path, f"/Asset/Rig/{role}", view, np.array(background))
        psnr = -10 * np.log10(((ours.image - drawn) ** 2).mean())
        assert ours.image.std() > 0.1
        # 74 dB with floats: ours adds 0.01 px^2. Halves round colors and shapes.
        assert psnr > (70 if precision == "float" else 55)


def test_same_scene_gives_the_same_bytes_and_touches_no_other_file(tmp_path: Path, package: Path):
    others = [tmp_path / name for name in ("default.usdc", "scene.usdc", "splats_full.usdc")]
    for other in others:
        other.write_bytes(b"mine")
    write_capture_scene(tmp_path / "scene.usdz", full_scene())
    assert (tmp_path / "scene.usdz").read_bytes() == package.read_bytes()
    assert all(other.read_bytes() == b"mine" for other in others)
    assert len(list(tmp_path.iterdir())) == 4


def test_scenes_that_make_no_sense_are_refused(tmp_path: Path):
    broken = splats(6)
    broken.means[2] = np.nan
    with pytest.raises(UsdError, match="1 of 6 splats hold NaN"):
        write_capture_scene(tmp_path / "a.usdz", CaptureScene(broken))
    with pytest.raises(UsdError, match="a capture is a package"):
        write_capture_scene(tmp_path / "a.usdc", full_scene())
    assert not list(tmp_path.iterdir())
    views = camera_path(views=2)
    other = (views.cameras[0], views.cameras[1].resized(44, 33))
    for name, value, words in (
        ("times", (0.0,), "2 cameras, 1 times"),
        ("times", (1.0, 0.0), "not ascending"),
        ("cameras", other, "different image sizes"),
    ):
        with pytest.raises(UsdError, match=words):
            replace(views, **{name: value})


def test_levels_hold_about_their_share_and_drop_what_matters_least_before_merging():
    for count, share in ((1, 0.1), (20, 0.1), (3000, 0.5)):
        wanted = max(1, int(share * count))
        assert 0.8 * wanted <= len(level_of_detail(splats(count), share)) <= wanted
    gaussians = splats(100)
    level = level_of_detail(gaussians, KEPT_BEFORE_MERGING)
    radii = np.sqrt(np.sort(gaussians.scales, axis=1)[:, 1:].prod(axis=1))
    kept = gaussians.select(np.sort(np.argsort(-gaussians.opacities * radii)[:60]))
    assert all((getattr(level, name) == getattr(kept, name)).all() for name in FIELDS)


def test_a_group_becomes_the_gaussian_of_the_same_moments():
    """Against the moments of many samples of the mixture."""
    gaussians = replace(splats(5, seed=3), opacity_logits=np.array([0.0, 1.0, -1.0, 2.0, 0.5]))
    merged = merged_in_voxels(gaussians, 1)
    assert len(merged) == 1
    rng = np.random.default_rng(0)
    weights = gaussians.opacities.astype(np.float64)
    weights /= weights.sum()
    chosen = rng.choice(5, size=400_000, p=weights)
    half = matrix_from_quat_xyzw(gaussians.quats) * gaussians.scales[:, None].astype(np.float64)
    samples = gaussians.means[chosen] + np.einsum(
        "nij,nj->ni", half[chosen], rng.normal(size=(len(chosen), 3))
    )
    assert_allclose(merged.means[0], samples.mean(axis=0), atol=2e-3)
    expected = np.cov(samples.T) * MERGED_WIDENING**2
    assert_allclose(
        covariances(merged.quats, merged.scales)[0], expected, atol=0.02 * np.abs(expected).max()
    )
    assert_allclose(merged.sh[0], np.einsum("n,nkc->kc", weights, gaussians.sh), atol=1e-6)
    # As much light is blocked: opacity times area, of the two longer axes.
    before, after = (
        g.opacities @ np.prod(np.sort(g.scales)[:, 1:], axis=1) for g in (gaussians, merged)
    )
    assert_allclose(after, before, rtol=1e-5)


def test_hard_cases_come_out_finite():
    cases = {
        "invisible": replace(splats(10), opacity_logits=np.full(10, -1e4)),
        "one place": replace(splats(10), means=np.ones((10, 3))),
        "a stray far away": replace(splats(10), means=np.vstack([splats(9).means, [[1e6] * 3]])),
        "needles": replace(splats(10), log_scales=np.tile([-1.0, -30.0, -30.0], (10, 1))),
    }
    for name, gaussians in cases.items():
        level = level_of_detail(gaussians, 0.5)
        assert 1 <= len(level) <= 5, name
        assert all(np.isfinite(getattr(level, array)).all() for array in FIELDS), name


def test_who_is_alone_in_a_voxel_stays_and_nobody_is_far_from_what_is_left():
    gaussians = replace(splats(200), means=splats(200).means * [1, 4, 0.5])
    merged = merged_in_voxels(gaussians, 150)
    distances, nearest = map(np.asarray, KDTree(gaussians.means).query(merged.means))
    alone, kept = merged.select(distances == 0), gaussians.select(nearest[distances == 0])
    assert 0.8 * 150 <= len(merged) <= 150 and len(alone) > 80
    assert all((getattr(alone, name) == getattr(kept, name)).all() for name in FIELDS)
    away = KDTree(merged.means).query(gaussians.means)[0]
    assert away.mean() < 0.016 and away.max() < 0.08


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
