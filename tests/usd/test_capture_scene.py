from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from digs_warp.checks import UsdError
from digs_warp.data.images import linear_from_srgb
from digs_warp.splat.render import render
from digs_warp.usd.capture_scene import CaptureScene, write_capture_scene
from digs_warp.usd.convert import Precision
from digs_warp.usd.lod import LEVELS, level_of_detail
from digs_warp.usd.reader import read_scene
from reference.capture_scenes import BASELINE, camera_path, full_scene, splats, tetrahedron
from reference.usd_files import Y_UP
from reference.usd_renderer import frustum_pixels, render_usd


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("capture") / "scene.usdz"
    write_capture_scene(path, full_scene())
    return path


def open_stage(path: Path):
    from pxr import Usd

    return Usd.Stage.Open(str(path))


def test_one_field_is_shown_and_variants_hold_its_levels(package: Path):
    stage = open_stage(package)
    fields = [p for p in stage.Traverse() if p.GetTypeName() == "ParticleField3DGaussianSplat"]
    assert [str(prim.GetPath()) for prim in fields] == ["/Asset/Gaussians"]
    assert len(fields[0].GetAttribute("positions").Get()) == 40
    for level, share in LEVELS.items():
        read = read_scene(package, variants={"lod": level}).gaussians
        expected = level_of_detail(full_scene().gaussians, share)
        assert_array_equal(read.means, expected.means)
        assert_allclose(read.log_scales, expected.log_scales, atol=1e-6)
    for chosen in ({"lod": "mesh"}, {"init": "full"}):
        with pytest.raises(UsdError, match=r"no variant '.*; there is lod: full, half, preview"):
            read_scene(package, variants=chosen)


@pytest.mark.parametrize("name", ["Mesh", "Surface"])
def test_meshes_are_guides_in_the_frame_of_the_asset(package: Path, name: str):
    from pxr import UsdGeom

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
    from pxr import UsdGeom

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
    from pxr import UsdGeom

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
