"""Exports, read back by the formats' own readers: every pixel has to come out where it was."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest

from digs_warp.camera import Camera, Intrinsics, pixel_centers
from digs_warp.capture import Capture
from digs_warp.capture_writer import CaptureWriter, FrameImages
from digs_warp.checks import CaptureError, DigsError
from digs_warp.commands.convert import CaptureFormat, Convert
from digs_warp.geometry import look_at, matrix_from_quat_xyzw, rigid
from digs_warp.images import encode_jpeg, read_image
from digs_warp.imports import MissingLibraryError, import_open3d, import_pycolmap
from digs_warp.interchange.bop import depth_scale
from digs_warp.interchange.common import encode_depth
from digs_warp.interchange.export import EXPORTERS, export_capture
from digs_warp.log import read_json

WIDTH, HEIGHT = 21, 14
# Nothing is symmetric: a swapped axis, a half pixel or a transposed matrix shows.
CAMERA = Intrinsics(WIDTH, HEIGHT, fx=19.0, fy=23.0, cx=9.25, cy=7.75)
TIMES = (0.0, 0.25, 1.5)


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    """Three noisy frames with a round object, holes in the depth, and soft mask edges."""
    rng = np.random.default_rng(0)
    writer = CaptureWriter(tmp_path_factory.mktemp("source") / "capture", CAMERA)
    u, v = np.moveaxis(pixel_centers(WIDTH, HEIGHT), -1, 0)
    distance = np.hypot(u - 8, v - 6)
    for number, time in enumerate(TIMES):
        depth = rng.uniform(0.6, 6.0, (HEIGHT, WIDTH)).astype(np.float32)
        depth[rng.random(depth.shape) < 0.2] = np.nan
        mask = np.clip(255 * (4.5 - distance), 0, 255).astype(np.uint8)
        image = rng.integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8)
        writer.write_frame(number, FrameImages(image=image, depth=depth, mask=mask))
        eye = np.array([1.0 + number, 0.3 - number, 0.7])
        writer.add_pose(number, look_at(eye, np.zeros(3), np.array([0.1, 0.2, 1.0])), time)
    return writer.finish()


def exported(capture: Capture, form: str, folder: Path) -> Path:
    export_capture(capture, form, folder)
    return folder


def with_last_frame(capture: Capture, **changes: Any) -> Capture:
    """The same capture with other values in its last frame."""
    return replace(capture, frames=(*capture.frames[:-1], replace(capture.frames[-1], **changes)))


def zoomed(capture: Capture) -> Capture:
    camera = capture.frames[-1].camera
    return with_last_frame(
        capture, camera=replace(camera, intrinsics=replace(camera.intrinsics, fx=30.0))
    )


def true_points(capture: Capture, number: int) -> np.ndarray:
    """World points of the known depth pixels, row by row."""
    frame = capture.frames[number]
    depth = frame.load_depth().astype(np.float64)
    points = frame.camera.unproject(pixel_centers(WIDTH, HEIGHT), depth)
    return points[np.isfinite(depth)]


def points_as_integer_centered(
    depth: np.ndarray, matrix: np.ndarray, world_from_cam: np.ndarray
) -> np.ndarray:
    """Back-project as OpenCV, the TUM tools and the BOP toolkit do: column 0 has u = 0."""
    v, u = np.nonzero(depth > 0)
    z = depth[v, u].astype(np.float64)
    x = (u - matrix[0, 2]) * z / matrix[0, 0]
    y = (v - matrix[1, 2]) * z / matrix[1, 1]
    return np.stack([x, y, z], axis=-1) @ world_from_cam[:3, :3].T + world_from_cam[:3, 3]


def rows(path: Path) -> list[list[str]]:
    """The words of each line that is no comment."""
    return [line.split() for line in path.read_text().splitlines() if not line.startswith("#")]


def open3d_or_skip() -> Any:
    try:
        return import_open3d()
    except MissingLibraryError as error:
        pytest.skip(str(error))


# COLMAP


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
    monkeypatch.setattr("digs_warp.interchange.colmap.MOST_POINTS", 60)
    model = import_pycolmap().Reconstruction(exported(capture, "colmap", tmp_path) / "sparse/0")
    assert 45 <= model.num_points3D() <= 60


# TUM RGB-D


def test_open3d_gets_the_points_back_from_tum(capture: Capture, tmp_path: Path) -> None:
    o3d = open3d_or_skip()
    folder = exported(capture, "tum", tmp_path)
    fx, fy, cx, cy = map(float, rows(folder / "calibration.txt")[0])
    intrinsic = o3d.camera.PinholeCameraIntrinsic(WIDTH, HEIGHT, fx, fy, cx, cy)
    colors = [folder / row[1] for row in rows(folder / "rgb.txt")]
    depths = [folder / row[1] for row in rows(folder / "depth.txt")]
    for number, row in enumerate(rows(folder / "groundtruth.txt")):
        t = np.array(row[1:], dtype=float)
        extrinsic = np.linalg.inv(rigid(matrix_from_quat_xyzw(t[3:]), t[:3]))
        depth = o3d.io.read_image(str(depths[number]))
        cloud = o3d.geometry.PointCloud.create_from_depth_image(
            depth, intrinsic, extrinsic, depth_scale=5000.0, depth_trunc=100.0
        )
        # A step of 0.2 mm, seen at up to 30 degrees from the axis.
        np.testing.assert_allclose(
            np.asarray(cloud.points), true_points(capture, number), atol=1.5e-4
        )
        color = np.asarray(o3d.io.read_image(str(colors[number])))
        np.testing.assert_array_equal(color, capture.frames[number].load_image())


def test_tum_files_follow_the_specification(capture: Capture, tmp_path: Path) -> None:
    folder = exported(capture, "tum", tmp_path)
    stamps = [row[0] for row in rows(folder / "groundtruth.txt")]
    assert [float(stamp) for stamp in stamps] == list(TIMES)
    for name in ("rgb", "depth"):
        assert rows(folder / f"{name}.txt") == [[stamp, f"{name}/{stamp}.png"] for stamp in stamps]
    calibration = np.array(rows(folder / "calibration.txt")[0], dtype=float)
    matrix = np.array([[calibration[0], 0, calibration[2]], [0, *calibration[[1, 3]]], [0, 0, 1]])
    for number, row in enumerate(rows(folder / "groundtruth.txt")):
        t = np.array(row[1:], dtype=float)
        depth = read_image(folder / f"depth/{row[0]}.png")[..., 0] / 5000.0
        found = points_as_integer_centered(
            depth, matrix, rigid(matrix_from_quat_xyzw(t[3:]), t[:3])
        )
        np.testing.assert_allclose(found, true_points(capture, number), atol=1.5e-4)


def test_tum_needs_times_that_differ(capture: Capture, tmp_path: Path) -> None:
    twice = with_last_frame(capture, time=0.25)
    with pytest.raises(CaptureError, match="several frames share a time"):
        export_capture(twice, "tum", tmp_path / "out")


# Redwood


def test_open3d_gets_the_points_back_from_redwood(capture: Capture, tmp_path: Path) -> None:
    o3d = open3d_or_skip()
    folder = exported(capture, "redwood", tmp_path)
    intrinsic = o3d.io.read_pinhole_camera_intrinsic(str(folder / "camera_intrinsic.json"))
    assert (intrinsic.width, intrinsic.height) == (WIDTH, HEIGHT)
    trajectory = o3d.io.read_pinhole_camera_trajectory(str(folder / "trajectory.log"))
    assert len(trajectory.parameters) == len(capture)
    for number, parameters in enumerate(trajectory.parameters):
        depth = o3d.io.read_image(str(folder / f"depth/{number:05d}.png"))
        cloud = o3d.geometry.PointCloud.create_from_depth_image(
            depth, intrinsic, parameters.extrinsic, depth_scale=1000.0, depth_trunc=100.0
        )
        np.testing.assert_allclose(
            np.asarray(cloud.points), true_points(capture, number), atol=7e-4
        )
        color = np.asarray(o3d.io.read_image(str(folder / f"color/{number:05d}.png")))
        np.testing.assert_array_equal(color, capture.frames[number].load_image())


@pytest.mark.parametrize("form", ["tum", "redwood"])
def test_formats_of_one_camera_refuse_two(capture: Capture, form: str, tmp_path: Path) -> None:
    with pytest.raises(CaptureError, match="2 different cameras"):
        export_capture(zoomed(capture), form, tmp_path / "out")


# BOP


def test_bop_puts_every_pixel_and_the_object_where_they_were(
    capture: Capture, tmp_path: Path
) -> None:
    """Read as the BOP toolkit reads: millimetres, row-wise matrices, integer pixel centres."""
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


def test_an_object_out_of_view_has_no_box(tmp_path: Path) -> None:
    writer = CaptureWriter(tmp_path / "capture", CAMERA)
    shape = (HEIGHT, WIDTH)
    empty = FrameImages(
        image=np.zeros((*shape, 3), np.uint8),
        depth=np.full(shape, np.nan, np.float32),
        mask=np.zeros(shape, np.uint8),
    )
    writer.write_frame(0, empty)
    writer.add_pose(0, np.eye(4), 0.0)
    capture = writer.finish()
    scene = exported(capture, "bop", tmp_path / "out") / "train/000000"
    ((info,),) = json.loads((scene / "scene_gt_info.json").read_text()).values()
    assert info["bbox_obj"] == [-1, -1, -1, -1]
    assert (info["px_count_all"], info["visib_fract"]) == (0, 0.0)


@pytest.mark.parametrize(
    ("farthest", "scale"), [(0.5, 0.1), (6.5535, 0.1), (6.56, 0.2), (32.0, 0.5), (99.0, 1.0)]
)
def test_bop_takes_the_finest_depth_scale_that_fits(farthest: float, scale: float) -> None:
    depth = np.array([[np.nan, 0.4, farthest]])
    assert depth_scale(depth) == scale


# All formats


def test_depth_that_16_bits_cannot_hold_becomes_unknown() -> None:
    depth = np.array([[np.nan, 0.0001, 1.0, 13.107, 13.1072]], dtype=np.float32)
    units, lost = encode_depth(depth, 5000.0)
    assert units.dtype == np.uint16
    np.testing.assert_array_equal(units, [[0, 0, 5000, 65535, 0]])
    assert lost == 1


def test_lost_depth_is_told(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    writer = CaptureWriter(tmp_path / "capture", CAMERA)
    depth = np.full((HEIGHT, WIDTH), 14.0, np.float32)
    depth[0] = 2.0
    image, mask = np.zeros((HEIGHT, WIDTH, 3), np.uint8), np.zeros((HEIGHT, WIDTH), np.uint8)
    writer.write_frame(0, FrameImages(image=image, depth=depth, mask=mask))
    writer.add_pose(0, np.eye(4), 0.0)
    export_capture(writer.finish(), "tum", tmp_path / "out")
    assert f"up to 13.11 m: {WIDTH * (HEIGHT - 1)} pixels" in caplog.text


@pytest.mark.parametrize("form", ["tum", "redwood", "bop"])
def test_missing_depth_is_named(capture: Capture, form: str, tmp_path: Path) -> None:
    files = {k: v for k, v in capture.frames[-1].files.items() if k != "depth_file_path"}
    bare = with_last_frame(capture, files=files)
    with pytest.raises(CaptureError, match="frame '0002': the capture has no 'depth_file_path'"):
        export_capture(bare, form, tmp_path / "out")


@pytest.mark.parametrize("form", list(EXPORTERS))
def test_one_pixel_of_one_frame_is_enough(form: str, tmp_path: Path) -> None:
    writer = CaptureWriter(tmp_path / "capture", Intrinsics(1, 1, 1.0, 1.0, 0.5, 0.5))
    pixel = FrameImages(
        image=np.full((1, 1, 3), 7, np.uint8),
        depth=np.ones((1, 1), np.float32),
        mask=np.full((1, 1), 255, np.uint8),
    )
    writer.write_frame(0, pixel)
    writer.add_pose(0, np.eye(4), 0.0)
    export_capture(writer.finish(), form, tmp_path / "out")
    images = [path for path in (tmp_path / "out").rglob("*.png") if "mask" not in str(path)]
    depths = [path for path in images if path.parent.name == "depth"]
    assert len(depths) == (0 if form.startswith("colmap") else 1)
    (image,) = set(images) - set(depths)
    np.testing.assert_array_equal(read_image(image), pixel.image)


def test_images_of_other_types_become_png(capture: Capture, tmp_path: Path) -> None:
    frame = capture.frames[-1]
    (tmp_path / "photo.jpg").write_bytes(encode_jpeg(frame.load_image(), quality=100))
    photo = with_last_frame(capture, files={**frame.files, "file_path": tmp_path / "photo.jpg"})
    folder = exported(photo, "redwood", tmp_path / "out")
    found = read_image(folder / "color/00002.png")
    np.testing.assert_array_equal(found, photo.frames[-1].load_image())


def test_the_command_writes_into_the_folder_it_stands_in(
    capture: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Convert(source=capture.folder, to="tum", out=Path(".")).execute()
    assert (tmp_path / "groundtruth.txt").is_file()


def test_unknown_formats_are_refused(capture: Capture, tmp_path: Path) -> None:
    with pytest.raises(DigsError, match="'ply': expected one of colmap, colmap-binary, tum"):
        export_capture(capture, "ply", tmp_path)


def test_the_command_offers_every_format() -> None:
    assert set(get_args(CaptureFormat)) == EXPORTERS.keys()


def test_the_command_leaves_a_complete_folder_or_none(capture: Capture, tmp_path: Path) -> None:
    out = tmp_path / "out"
    message = Convert(source=capture.folder, to="tum", out=out).execute()
    assert "3 frames as tum" in message
    assert read_json(out / "run.json", "record")["settings"]["to"] == "tum"
    with pytest.raises(DigsError, match="not empty"):
        Convert(source=capture.folder, to="bop", out=out).execute()
    Convert(source=capture.folder, to="bop", out=out, overwrite=True).execute()
    assert not (out / "rgb.txt").exists() and (out / "camera.json").exists()
    bare = tmp_path / "bare"
    writer = CaptureWriter(bare, CAMERA)
    writer.write_frame(
        0,
        FrameImages(
            image=np.zeros((HEIGHT, WIDTH, 3), np.uint8),
            depth=np.ones((HEIGHT, WIDTH), np.float32),
            mask=np.zeros((HEIGHT, WIDTH), np.uint8),
        ),
    )
    writer.add_pose(0, np.eye(4), 0.0)
    writer.finish()
    (bare / "masks/0000.png").write_bytes(b"no image")
    with pytest.raises(DigsError, match=r"masks/0000\.png"):
        Convert(source=bare, to="bop", out=tmp_path / "broken").execute()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bare", "out"]


def test_exports_do_not_depend_on_their_threads(capture: Capture, tmp_path: Path) -> None:
    for form in EXPORTERS:
        first, second = (exported(capture, form, tmp_path / form / name) for name in "ab")
        files = [path.relative_to(first) for path in sorted(first.rglob("*")) if path.is_file()]
        assert files
        for path in files:
            assert (first / path).read_bytes() == (second / path).read_bytes()


def test_cameras_of_the_module_are_not_symmetric(capture: Capture) -> None:
    cameras: list[Camera] = [frame.camera for frame in capture.frames]
    assert all(abs(c.world_from_cam - c.world_from_cam.T).max() > 0.1 for c in cameras)
