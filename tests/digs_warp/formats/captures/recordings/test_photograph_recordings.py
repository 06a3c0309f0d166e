"""Photographs with poses, as COLMAP and nerfstudio have them: with and without lenses, and broken ones."""

import json
import logging
import re
import shutil
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from digs_warp.bounds import TEXT
from digs_warp.checks import CaptureError, DigsError
from digs_warp.cli import main
from digs_warp.data.capture import Capture, read_capture
from digs_warp.data.images import read_image, write_image
from digs_warp.formats.captures.formats import export_capture, read_recording
from digs_warp.formats.captures.lens import Lens
from digs_warp.geometry.rigid import OPENCV_FROM_OPENGL
from digs_warp.record.files import to_json
from reference.handed_in import nerfstudio
from reference.recorded import WIDTH, check_same, converted


@pytest.fixture(scope="module")
def workspace(capture: Capture, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The small capture as COLMAP would have it, as text."""
    folder = tmp_path_factory.mktemp("colmap") / "text"
    export_capture(capture, "colmap-text", folder)
    return folder


@pytest.fixture
def copy(workspace: Path, tmp_path: Path) -> Path:
    return shutil.copytree(workspace, tmp_path / "workspace")


@pytest.mark.parametrize("form", ["colmap", "colmap-text"])
def test_exports_come_back_with_images_masks_poses_and_points(
    capture: Capture, form: str, tmp_path: Path
) -> None:
    export_capture(capture, form, tmp_path / "colmap")
    found = converted("colmap", tmp_path / "colmap", tmp_path / "capture")
    assert found.knows_poses and len(found) == len(capture)
    for frame, true in zip(found.frames, capture.frames, strict=True):
        assert frame.camera.intrinsics == true.camera.intrinsics
        np.testing.assert_allclose(
            frame.camera.world_from_cam, true.camera.world_from_cam, atol=1e-12
        )
        np.testing.assert_array_equal(frame.load_image(), true.load_image())
        np.testing.assert_array_equal(frame.load_mask() > 127, true.load_mask() > 127)
    assert np.diff([frame.time for frame in found.frames]) == pytest.approx(1.0)  # no film
    points = found.load_points()
    assert points is not None and len(points) > 0
    if form == "colmap-text":
        table = np.loadtxt(tmp_path / "colmap/sparse/0/points3D.txt", usecols=(1, 2, 3))
        np.testing.assert_allclose(points.points_world, table, rtol=1e-6)


def test_a_field_of_view_can_be_chosen(copy: Path, tmp_path: Path) -> None:
    camera = "1 OPENCV_FISHEYE 21 14 19 23 9.25 7.75 .01 .0 .0 .0\n"
    (copy / "sparse/0/cameras.txt").write_text(camera)
    out = tmp_path / "capture"
    line = ["convert", str(copy), "--from", "colmap", "--out", str(out)]
    assert main([*line, "--fov-deg", "40"]) == 0
    k = read_capture(out).frames[0].camera.intrinsics
    assert k.fx == pytest.approx(10.5 / np.tan(np.deg2rad(20))) and k.fy / k.fx == 23 / 19
    view = read_recording(copy, "colmap").with_field_of_view(40).frames[0].view
    assert view is not None
    seen = read_capture(out).frames[0].load_image()
    np.testing.assert_array_equal(seen, view.apply(read_image(copy / "images/0000.png")))
    (copy / "sparse/0/cameras.txt").write_text("1 PINHOLE 21 14 19 23 9.25 7.75\n")
    with pytest.raises(CaptureError, match="no lens distortion"):
        read_recording(copy, "colmap").with_field_of_view(40)


def test_images_may_have_several_sizes_and_cameras(copy: Path, tmp_path: Path) -> None:
    write_image(copy / "images/0001.png", np.full((20, 10, 3), 77, np.uint8))
    shutil.rmtree(copy / "masks")
    with (copy / "sparse/0/cameras.txt").open("a") as file:
        file.write("2 PINHOLE 10 20 30 31 5 10\n")
    path = copy / "sparse/0/images.txt"
    path.write_text(path.read_text().replace(" 1 0001.png", " 2 0001.png"))
    found = converted("colmap", copy, tmp_path / "capture")
    sizes = [(f.camera.intrinsics.width, f.camera.intrinsics.height) for f in found.frames]
    assert sizes == [(21, 14), (10, 20), (21, 14)]
    assert found.frames[1].load_image().shape == (20, 10, 3)


def test_images_that_are_not_there_are_left_out(copy: Path, tmp_path: Path, caplog) -> None:
    (copy / "images/0001.png").unlink()
    assert len(converted("colmap", copy, tmp_path / "capture")) == 2
    assert "1 image of the model are not in" in caplog.text and "0001.png" in caplog.text


def test_the_largest_of_several_models_is_read(copy: Path, caplog) -> None:
    shutil.copytree(copy / "sparse/0", copy / "sparse/1")
    path = copy / "sparse/0/images.txt"
    path.write_text("\n".join(path.read_text().splitlines()[:6]) + "\n")
    with caplog.at_level(logging.WARNING):
        assert len(read_recording(copy, "colmap").frames) == 3
    assert "2 models; reading the largest" in caplog.text


def edit(path: str, change: Callable[[str], str]) -> Callable[[Path], object]:
    return lambda folder: (folder / path).write_text(change((folder / path).read_text()))


CAMERAS, IMAGES, POINTS = (f"sparse/0/{name}.txt" for name in ("cameras", "images", "points3D"))
BROKEN: dict[str, tuple[Callable[[Path], object], str]] = {
    "unknown model": (edit(CAMERAS, lambda s: s.replace("PINHOLE", "PANORAMA")), "PANORAMA with 4"),
    "no formula": (
        edit(CAMERAS, lambda _: "1 EQUIRECTANGULAR 21 14 21 14\n"),
        "camera model EQUIRECTANGULAR, expected one of",
    ),
    "few parameters": (
        edit(CAMERAS, lambda _: "1 PINHOLE 21 14 19\n"),
        "PINHOLE with 1 parameters, expected 4",
    ),
    "words": (edit(CAMERAS, lambda s: s.replace("21 14", "wide high")), "cameras of a COLMAP model"),
    "endless": (edit(CAMERAS, lambda s: s.replace("21 14", "inf 14")), "cameras of a COLMAP model"),
    "other camera": (edit(IMAGES, lambda s: s.replace(" 1 0001", " 7 0001")), "has camera 7"),
    "no images": (edit(IMAGES, lambda _: "# none\n"), "has no images"),
    "other size": (edit(CAMERAS, lambda s: s.replace("21 14", "640 480")), "expected 640x480"),
    "points": (edit(POINTS, lambda s: s + "9 1 2\n"), "points of a COLMAP model"),
    "not UTF-8": (
        lambda folder: (folder / IMAGES).write_bytes(b"# caf\xe9\n"),
        "^COLMAP file '.*': not UTF-8",
    ),
    "no focal length": (edit(CAMERAS, lambda _: "1 PINHOLE 21 14 0 0 9 7\n"), "^recording '.*fx=0"),
    "no folder": (lambda folder: (folder / "images").rename(folder / "photos"), "none of the model"),
}  # fmt: skip


@pytest.mark.parametrize("name", BROKEN)
def test_broken_workspaces_are_explained(copy: Path, tmp_path: Path, name: str) -> None:
    spoil, message = BROKEN[name]
    spoil(copy)
    with pytest.raises(DigsError, match=message):
        converted("colmap", copy, tmp_path / "capture")


def test_a_large_model_in_text_is_read(copy: Path, tmp_path: Path) -> None:
    path = copy / "sparse/0/images.txt"
    images = [line for line in path.read_text().splitlines() if line.endswith(".png")]
    points = " ".join(["1234.5 678.9 1"] * (TEXT.most // 45))
    path.write_text("\n".join(f"{line}\n{points}" for line in images))
    assert path.stat().st_size > TEXT.most
    assert len(converted("colmap", copy, tmp_path / "capture")) == len(images) == 3


def test_binary_files_that_promise_more_than_they_hold_are_refused(
    capture: Capture, tmp_path: Path
) -> None:
    export_capture(capture, "colmap", tmp_path)
    for name in ("cameras", "images", "points3D"):
        path = tmp_path / f"sparse/0/{name}.bin"
        whole = path.read_bytes()
        for broken in (struct.pack("<Q", 2**63) + whole[8:], whole[:-3], whole[:5]):
            path.write_bytes(broken)
            with pytest.raises(CaptureError, match=f"{name}.bin"):
                read_recording(tmp_path, "colmap")
        path.write_bytes(whole)
    assert len(read_recording(tmp_path, "colmap").frames) == 3


def test_our_own_folder_is_a_nerfstudio_recording(capture: Capture, tmp_path: Path) -> None:
    check_same(converted("nerfstudio", capture.folder, tmp_path), capture, 1e-12)


BROKEN_POSES: dict[str, tuple[Callable[[np.ndarray], np.ndarray], str]] = {
    "lost": (lambda pose: pose * np.nan, "1 of 9 frames have no pose and are left out"),
    "zeros": (lambda pose: pose * 0, "1 of 9 frames have no pose and are left out"),
    "scaled": (
        lambda pose: pose @ np.diag([1.3, 1.3, 1.3, 1]),
        "1 frame of 9 with a broken pose .*stretch by .1.3 1.3 1.3",
    ),
    "mirrored": (lambda pose: pose @ np.diag([-1, 1, 1, 1]), "they mirror"),
}


@pytest.mark.parametrize("name", BROKEN_POSES)
def test_a_single_broken_pose_costs_one_frame(
    capture: Capture, tmp_path: Path, caplog, name: str
) -> None:
    change, message = BROKEN_POSES[name]
    index = nerfstudio(capture, tmp_path / "ns")
    frames = [dict(frame) for frame in index["frames"] * 3]
    for number, frame in enumerate(frames):
        name = f"images/again{number}.png"
        shutil.copy(tmp_path / "ns" / frame["file_path"], tmp_path / "ns" / name)
        frame["file_path"] = name
    frames[4]["transform_matrix"] = change(np.array(frames[4]["transform_matrix"])).tolist()
    index["frames"] = frames
    (tmp_path / "ns/transforms.json").write_text(json.dumps(index))
    found = converted("nerfstudio", tmp_path / "ns", tmp_path / "capture")
    assert len(found) == 8 and found.knows_poses
    assert re.search(message, caplog.text)
    if name == "scaled":  # a quarter of them is a mistake in all
        (tmp_path / "ns/transforms.json").write_text(json.dumps(index | {"frames": frames[3:6]}))
        with pytest.raises(CaptureError, match="no rotation: they stretch"):
            converted("nerfstudio", tmp_path / "ns", tmp_path / "many")


def test_the_scale_that_nerfstudio_applied_is_taken_back(capture: Capture, tmp_path: Path) -> None:
    index = nerfstudio(capture, tmp_path / "ns")
    for frame in index["frames"]:
        for row in frame["transform_matrix"][:3]:
            row[:] = np.round([*row[:3], 0.25 * row[3]], 6).tolist()  # scanners write few digits
    (tmp_path / "ns/transforms.json").write_text(to_json(index | {"applied_scale": 0.25}))
    found = converted("nerfstudio", tmp_path / "ns", tmp_path / "capture")
    centers = [frame.camera.center_world for frame in found.frames]
    expected = [frame.camera.center_world for frame in capture.frames]
    np.testing.assert_allclose(centers, expected, atol=1e-5)


def test_synthetic_scenes_have_a_field_of_view_and_no_suffixes(
    capture: Capture, tmp_path: Path
) -> None:
    folder = tmp_path / "synthetic"
    entries = []
    for number, frame in enumerate(capture.frames):
        write_image(
            folder / f"train/r_{number}.png", np.dstack([frame.load_image(), frame.load_mask()])
        )
        matrix = (frame.camera.world_from_cam @ OPENCV_FROM_OPENGL).tolist()
        entries.append({"file_path": f"./train/r_{number}", "transform_matrix": matrix})
    (folder / "transforms.json").write_text(to_json({"camera_angle_x": 0.7, "frames": entries}))
    found = converted("nerfstudio", folder, tmp_path / "capture")
    k = found.frames[0].camera.intrinsics
    assert k.fx == pytest.approx(0.5 * WIDTH / np.tan(0.35)) and (k.cx, k.cy) == (10.5, 7.0)
    np.testing.assert_array_equal(found.frames[0].load_image(), capture.frames[0].load_image())
    np.testing.assert_array_equal(found.frames[0].load_mask(), capture.frames[0].load_mask())


def test_a_fisheye_lens_is_taken_out(capture: Capture, tmp_path: Path) -> None:
    lens = {"k1": 0.05, "k2": 0.01, "k3": 0.0, "k4": 0.0}
    nerfstudio(capture, tmp_path / "named", camera_model="OPENCV_FISHEYE", **lens)
    nerfstudio(capture, tmp_path / "said", is_fisheye=True, **lens)
    named, said = (
        converted("nerfstudio", tmp_path / name, tmp_path / f"{name} capture")
        for name in ("named", "said")
    )
    view = read_recording(tmp_path / "named", "nerfstudio").frames[0].view
    assert view is not None and view.lens == Lens((0.05, 0.01, 0.0, 0.0), is_fisheye=True)
    found = named.frames[0].load_image()
    np.testing.assert_array_equal(found, said.frames[0].load_image())
    recorded = read_image(tmp_path / "named/images/0000.png")
    np.testing.assert_array_equal(found, view.apply(recorded))
    assert (found != recorded).any()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"camera_model": "OPENCV_FISHEYE", "p1": 0.1}, "OPENCV_FISHEYE with p1, expected only k1"),
        ({"camera_model": "EQUIRECTANGULAR"}, "camera_model is 'EQUIRECTANGULAR', expected one of"),
        ({"k1": 1e9}, "show 0% of the pinhole images"),
        ({"k1": 0.1, "w": 48 * 10**9}, "its camera: 672,000,000,000 pixels, expected up to"),
        ({"camera_model": "OPENCV", "k1": 0.1, "k5": 0.01}, "OPENCV with k5, expected only k1, k2"),
        ({"k1": "much"}, "frame 0 .*k1 is 'much', expected a finite number"),
        ({"depth_unit_scale_factor": -1}, "depth_unit_scale_factor is -1"),
        ({"frames": []}, "lists no frames"),
        ({"w": 640, "h": 480}, r"21x14 pixels, expected 640x480 .*give the camera of these images"),
        ({"w": 14, "h": 21}, r"21x14 pixels, expected 14x21 .*on its side.*-auto-orient"),
        ({"fl_x": -3.0}, "expected pixels above 0"),
        ({"fl_x": "wide"}, "frame 0"),
    ],
)
def test_nerfstudio_folders_that_cannot_be_used(
    capture: Capture, tmp_path: Path, changes: dict[str, Any], message: str
) -> None:
    nerfstudio(capture, tmp_path / "ns", **changes)
    with pytest.raises(DigsError, match=message):
        converted("nerfstudio", tmp_path / "ns", tmp_path / "capture")


def test_a_fourth_radial_coefficient_goes_with_the_eighth_power(
    capture: Capture, tmp_path: Path
) -> None:
    nerfstudio(capture, tmp_path / "ns", k1=0.1, k2=-0.02, k3=0.003, k4=0.4)
    view = read_recording(tmp_path / "ns", "nerfstudio").frames[0].view
    assert view is not None and view.lens is not None
    x, y = 0.5, -0.3
    square = x**2 + y**2
    factor = 1 + 0.1 * square - 0.02 * square**2 + 0.003 * square**3 + 0.4 * square**4
    bent = view.lens.distort(np.array([2 * x, 2 * y, 2.0]))
    np.testing.assert_allclose(bent, [x * factor, y * factor], rtol=1e-12)
    # The model that is OpenCV's own has it in the denominator.
    nerfstudio(capture, tmp_path / "full", camera_model="FULL_OPENCV", k1=0.1, k4=0.4, k6=0.2)
    view = read_recording(tmp_path / "full", "nerfstudio").frames[0].view
    assert view is not None and view.lens == Lens((0.1, 0, 0, 0, 0, 0.4, 0, 0.2))
