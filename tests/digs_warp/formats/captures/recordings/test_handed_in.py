"""What people hand in, after public bug reports: files of other programs that are not quite as expected.

Each test makes its own input; the right result is that of the same recording without its peculiarity.
"""

import json
import re
import shutil
from collections.abc import Callable
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import CaptureError
from digs_warp.data.capture import Capture, read_capture
from digs_warp.data.images import encode_jpeg, write_image
from digs_warp.formats.captures.colmap_files import PARAMETERS, ModelCamera
from digs_warp.formats.captures.colmap_import import pinhole_and_lens
from digs_warp.formats.captures.formats import export_capture, read_recording
from digs_warp.geometry.rigid import OPENCV_FROM_OPENGL, far_offset
from reference.handed_in import handed_in, nerfstudio, read, save
from reference.recorded import CAMERA, HEIGHT, WIDTH, check_same, converted

SMALL = np.random.default_rng(3).integers(0, 256, (HEIGHT // 2, WIDTH // 2, 3), dtype=np.uint8)


@pytest.mark.parametrize("blank", ["", "\n", "\n\n"])
def test_colmap_text_needs_no_second_line(capture: Capture, tmp_path: Path, blank: str) -> None:
    folder = tmp_path / "colmap"
    export_capture(capture, "colmap-text", folder)
    path = folder / "sparse/0/images.txt"
    images = [line for line in path.read_text().splitlines() if line.endswith(".png")]
    path.write_text("  # images\n" + "".join(f"{line}\n{blank}" for line in images))
    assert len(read_recording(folder, "colmap").frames) == len(capture)
    path.write_text(f"{images[0]}\n1.5 2.5 -1\n{images[1]}\n{images[2]}\n1 2 3 4 5 6 7 8 9 1 2 3\n")
    assert len(read_recording(folder, "colmap").frames) == len(capture)


def far(folder: Path, form: str, offset: np.ndarray) -> None:
    """Move the world of an export."""
    if form == "nerfstudio":
        index = json.loads((folder / "transforms.json").read_text())
        for frame in index["frames"]:
            for row, shift in zip(frame["transform_matrix"], offset, strict=False):
                row[3] += shift
        save(folder, index)
        return
    path = folder / "groundtruth.txt"
    rows = [line.split() for line in path.read_text().splitlines() if line[0] != "#"]
    for row in rows:
        row[1:4] = [f"{float(a) + b:.9f}" for a, b in zip(row[1:4], offset, strict=True)]
    path.write_text("\n".join(map(" ".join, rows)))


@pytest.mark.parametrize("form", ["nerfstudio", "tum", "as it is"])
def test_survey_coordinates_are_taken_off_and_kept(
    capture: Capture, tmp_path: Path, form: str
) -> None:
    offset = np.array([431000.0, 4582000.0, 120.0])
    kind, folder = handed_in(capture, form, tmp_path)
    near = converted(kind, folder, tmp_path / "near")
    far(folder, kind, offset)
    if form != "tum":
        points = near.load_points()
        assert points is not None
        table = ["ply", "format ascii 1.0", f"element vertex {len(points)}"]
        table += [f"property double {axis}" for axis in "xyz"] + ["end_header"]
        table += [
            " ".join(f"{v:.6f}" for v in row + offset) for row in points.points_world.tolist()
        ]
        (folder / "sparse_pc.ply").write_text("\n".join(table) + "\n")
    found = read(form, folder, tmp_path / "c")
    assert found.about.world_offset is not None
    moved = np.array(found.about.world_offset) - offset
    assert np.linalg.norm(moved) < 10
    for frame, true in zip(found.frames, near.frames, strict=True):
        expected = true.camera.center_world - moved
        np.testing.assert_allclose(frame.camera.center_world, expected, atol=1e-6)
    if form != "tum":
        again = found.load_points()
        assert again is not None and points is not None
        np.testing.assert_allclose(again.points_world, points.points_world - moved, atol=2e-5)


def test_a_lost_camera_does_not_keep_a_scene_far_away() -> None:
    places = np.array([[0, 0, 0], [4e6, 0, 0], [4e6 + 3, 1.0, 0]])
    assert np.abs(np.array(far_offset(places)) - places[1]).max() < 4


def lost_tum(text: str, words: str) -> str:
    lines = text.splitlines()
    lines[-2] = f"{lines[-2].split()[0]} {words}"
    return "\n".join(lines)


def lost_log(text: str, words: str) -> str:
    lines = text.splitlines()
    rows = np.eye(4) * float(words[-1])
    lines[6:10] = [" ".join(map(str, row)) for row in rows.tolist()]
    return "\n".join(lines)


def lost_nerfstudio(text: str, words: str) -> str:
    index = json.loads(text)
    index["frames"][1]["transform_matrix"] = (OPENCV_FROM_OPENGL * float(words[-1])).tolist()
    return json.dumps(index)


def lost_colmap(text: str, words: str) -> str:
    x, y, z, *turn, w = words.split()
    return re.sub(r"\n2( \S+){7}", f"\n2 {' '.join([w, *turn, x, y, z])}", text)


LOST: dict[str, tuple[str, Callable[[str, str], str]]] = {
    "tum": ("groundtruth.txt", lost_tum),
    "redwood": ("trajectory.log", lost_log),
    "nerfstudio": ("transforms.json", lost_nerfstudio),
    "colmap-text": ("sparse/0/images.txt", lost_colmap),
}


@pytest.mark.parametrize("words", ["0 0 0 0 0 0 0", "0 0 0 0 0 0 1"])
@pytest.mark.parametrize("form", LOST)
def test_a_lost_pose_is_unknown(capture: Capture, tmp_path: Path, form: str, words: str) -> None:
    export_capture(capture, form, tmp_path / "r")
    name, lose = LOST[form]
    path = tmp_path / "r" / name
    path.write_text(lose(path.read_text(), words))
    found = converted(form.removesuffix("-text"), tmp_path / "r", tmp_path / "c")
    assert len(found) == 2 and found.knows_poses
    for frame, number in zip(found.frames, (0, 2), strict=True):
        expected = capture.frames[number].camera.world_from_cam
        np.testing.assert_allclose(frame.camera.world_from_cam, expected, atol=1e-6)


@pytest.mark.parametrize("form", ["colmap-text", "nerfstudio", "tum", "redwood", "bop"])
def test_a_byte_order_mark_is_no_text(capture: Capture, tmp_path: Path, form: str) -> None:
    export_capture(capture, form, tmp_path / "r")
    kind = form.removesuffix("-text")
    expected = converted(kind, tmp_path / "r", tmp_path / "plain")
    for path in (each for end in ("txt", "json", "log") for each in tmp_path.glob(f"r/**/*.{end}")):
        lines = [line for line in path.read_bytes().splitlines() if not line.startswith(b"#")]
        path.write_bytes(b"\xef\xbb\xbf" + b"\r\n".join(lines) + b"\r\n")
    found = converted(kind, tmp_path / "r", tmp_path / "c")
    assert len(found) == len(expected)
    if kind != "colmap":
        check_same(found, expected, 1e-9)


def test_an_index_of_training_frames_alone_is_read(
    capture: Capture, tmp_path: Path, caplog
) -> None:
    folder = tmp_path / "ns"
    index = nerfstudio(capture, folder)
    (folder / "transforms.json").rename(folder / "transforms_train.json")
    check_same(converted("nerfstudio", folder, tmp_path / "c"), capture, 1e-3)
    save(folder, index | {"frames": index["frames"][:1]}, "transforms_test.json")
    assert len(converted("nerfstudio", folder, tmp_path / "again")) == len(capture)
    assert "not those of transforms_test.json" in caplog.text
    with pytest.raises(CaptureError, match=r"transforms_train.json.*--from nerfstudio"):
        read_capture(folder)


@pytest.mark.parametrize(
    ("form", "kind"),
    [
        *product(["nerfstudio", "colmap-text", "tum"], ["backslash", "case", "accents apart"]),
        *(("nerfstudio", "folder"), ("tum", "folder")),
    ],
)
def test_names_from_another_system_are_read(
    capture: Capture, tmp_path: Path, form: str, kind: str
) -> None:
    folder = tmp_path / "r"
    export_capture(capture, form, folder)
    index = {
        "nerfstudio": "transforms.json",
        "colmap-text": "sparse/0/images.txt",
        "tum": "rgb.txt",
    }
    path = folder / index[form]
    if form == "colmap-text":
        (folder / "images/left").mkdir()
        for image in (folder / "images").glob("*.png"):
            image.rename(folder / "images/left" / image.name)
        shutil.rmtree(folder / "masks")
        path.write_text(re.sub(r"(\d{4}\.png)", r"left/\1", path.read_text()))
    if kind == "accents apart":
        for image in (folder / "rgb" if form == "tum" else folder).rglob("*.png"):
            image.rename(image.with_name(f"caf\u00e9{image.name}"))
    text = path.read_text()
    if kind == "accents apart":
        changed = re.sub(r"([\d.]+\.png)", "cafe\u0301\\1", text)
    elif kind == "folder":
        changed = re.sub(r"((images|rgb)/)", r"/home/me/ns/\1", text)
    elif kind == "case":
        changed = text.replace(".png", ".PNG").replace("rgb/", "RGB/").replace("left/", "Left/")
    else:
        slash = r"\\\\" if form == "nerfstudio" else r"\\"
        changed = re.sub(r"(images|masks|depth|left|rgb)/", rf"\1{slash}", text)
    assert changed != text
    path.write_text(changed)
    found = converted(form.removesuffix("-text"), folder, tmp_path / "c")
    for frame, true in zip(found.frames, capture.frames, strict=True):
        np.testing.assert_array_equal(frame.load_image(), true.load_image())
    if form == "nerfstudio" and kind != "folder":
        assert len(read_capture(folder)) == len(capture)


@pytest.mark.parametrize("form", ["nerfstudio", "colmap"])
def test_smaller_images_are_taken_with_their_camera(
    capture: Capture, tmp_path: Path, form: str
) -> None:
    folder = tmp_path / "r"
    export_capture(capture, form, folder)
    for path in sorted((folder / "images").iterdir()):
        write_image(folder / "images_2" / path.name, SMALL)
    shutil.rmtree(folder / "images")
    found = converted(form, folder, tmp_path / "c")
    k = found.frames[0].camera.intrinsics
    assert (k.width, k.height) == (WIDTH // 2, HEIGHT // 2)
    assert k.fx == pytest.approx(CAMERA.fx * (WIDTH // 2) / WIDTH)
    assert k.cy == pytest.approx(CAMERA.cy / 2)
    np.testing.assert_array_equal(found.frames[0].load_image(), SMALL)
    assert found.frames[0].load_mask().shape == SMALL.shape[:2]


def test_all_lenses_of_colmap_bend_light_as_colmap_says() -> None:
    pycolmap = pytest.importorskip("pycolmap")
    values = {"s": 30.0, "fx": 30.0, "fy": 33.0, "cx": 20.0, "cy": 15.0, "omega": 0.9, "k": -0.1}
    values |= {"alpha": 0.6, "beta": 1.1, "k1": 0.05, "k2": 0.01, "k3": 0.001, "k4": 0.002}
    values |= {"k5": 0.01, "k6": 0.003, "p1": 0.001, "p2": 0.002}
    rays = np.random.default_rng(0).uniform(-0.6, 0.6, (50, 3))
    rays[:, 2] = 1.0
    for model, names in PARAMETERS.items():
        if isinstance(names, int):
            continue
        params = tuple(values[name] for name in names.split())
        k, lens = pinhole_and_lens(ModelCamera(model, 40, 30, params), "here")
        bent = rays[:, :2] if lens is None else lens.distort(rays)
        expected = pycolmap.Camera(model=model, width=40, height=30, params=params)
        places = bent * [k.fx, k.fy] + [k.cx, k.cy]
        np.testing.assert_allclose(places, expected.img_from_cam(rays), atol=1e-9)
    assert {"FISHEYE", "SIMPLE_DIVISION", "DIVISION", "EUCM", "FOV"} <= PARAMETERS.keys()


@pytest.mark.parametrize("per_second", [1e9, 1e6])
@pytest.mark.parametrize("start", [0.0, 1_700_000_000.0])
@pytest.mark.parametrize("truth", [True, False])
def test_times_of_tum_may_be_in_another_unit(
    capture: Capture, tmp_path: Path, per_second: float, start: float, truth: bool
) -> None:
    folder = tmp_path / "tum"
    export_capture(capture, "tum", folder)
    for name in ("rgb.txt", "depth.txt", "groundtruth.txt"):
        rows = [line.split() for line in (folder / name).read_text().splitlines() if line[0] != "#"]
        unit = per_second if name != "groundtruth.txt" or truth else 1
        for row in rows:
            time = float(row[0]) + start
            row[0] = str(round(time * unit)) if unit > 1 else f"{time:.6f}"
        (folder / name).write_text("\n".join(map(" ".join, rows)))
    found = converted("tum", folder, tmp_path / "c")
    check_same(found, capture, 1e-3)
    times = [frame.time for frame in found.frames]
    np.testing.assert_allclose(times, [frame.time for frame in capture.frames], atol=1e-5)


@pytest.mark.parametrize("own", [False, True])
@pytest.mark.parametrize("scale", [1, 2])
@pytest.mark.parametrize("order", [[0, 1, 2, 3], [1, 0, 3, 2]])  # before the phone turned the image
def test_record3d_may_exchange_width_and_height(
    tmp_path: Path, scale: int, own: bool, order: list[int]
) -> None:
    upright = np.zeros((2 * WIDTH, 2 * HEIGHT, 3), np.uint8)
    (tmp_path / "rgb").mkdir()
    for number in range(2):
        (tmp_path / f"rgb/{number}.jpg").write_bytes(encode_jpeg(upright))
    row = np.array([50.0, 52.0, 2 * HEIGHT / 2 + 1, 2 * WIDTH / 2 - 2]) * scale
    fx, fy, cx, cy = row[order]
    metadata = {
        "w": 2 * WIDTH * scale,
        "h": 2 * HEIGHT * scale,
        "K": [fx, 0, 0, 0, fy, 0, cx, cy, 1],
    }
    each = [[fx, fy, cx, cy], [fx + 1, fy + 1, cx, cy]]
    metadata |= {"perFrameIntrinsicCoeffs": each} if own else {}
    save(tmp_path, metadata, "metadata.json")
    k, then = (frame.intrinsics for frame in read_recording(tmp_path, "record3d").frames)
    assert (k.width, k.height) == (2 * HEIGHT, 2 * WIDTH)
    np.testing.assert_allclose([k.fx, k.fy, k.cx, k.cy], row / scale)
    np.testing.assert_allclose([then.fx, then.fy], (row[:2] + own) / scale)


def test_a_link_to_another_disk_is_read_or_its_cure_named(capture: Capture, tmp_path: Path) -> None:
    folder = tmp_path / "ns"
    nerfstudio(capture, folder)
    (folder / "images").rename(tmp_path / "disk")
    (folder / "images").symlink_to(tmp_path / "disk")
    check_same(converted("nerfstudio", folder, tmp_path / "c"), capture, 1e-3)
    with pytest.raises(CaptureError, match=r"a link leads to '.*disk.*--from nerfstudio.*copies"):
        read_capture(folder)


def test_what_is_not_read_is_said(capture: Capture, tmp_path: Path, caplog) -> None:
    folder = tmp_path / "tum"
    export_capture(capture, "tum", folder)
    write_image(folder / "rgb/9.png", SMALL)
    (folder / "accelerometer.txt").write_text("0 1 2 3\n")
    (folder / "flow").mkdir()
    for number in range(3):
        (folder / f"flow/{number}.flo").write_text("x")
    (folder / "README.txt").write_text("Read me.")
    converted("tum", folder, tmp_path / "c")
    said = "not read: accelerations ('accelerometer.txt'), 'flow/*.flo', 3 files, 'rgb/*.png'\n"
    assert said in caplog.text


def edited(path: Path, change: Callable[[str], str]) -> None:
    path.write_text(change(path.read_text()))


IMAGES = "sparse/0/images.txt"
DOUBLED: dict[str, tuple[str, Callable[[str], str]]] = {
    "nerfstudio": ("transforms.json", str),
    "colmap-text": (IMAGES, lambda s: s + "99 1 0 0 0 0 0 0 1 0001.png\n"),
    "tum": ("rgb.txt", lambda s: s + s.splitlines()[-1] + "\n"),
}


@pytest.mark.parametrize("form", DOUBLED)
def test_an_image_that_is_named_twice_counts_once(
    capture: Capture, tmp_path: Path, form: str, caplog
) -> None:
    export_capture(capture, form, tmp_path / "r")
    name, double = DOUBLED[form]
    if form == "nerfstudio":
        index = json.loads((tmp_path / "r" / name).read_text())
        again = index["frames"][0] | {"time": 9.0}
        save(tmp_path / "r", index | {"frames": [*index["frames"], again]})
    else:
        edited(tmp_path / "r" / name, double)
    made = converted(form.removesuffix("-text"), tmp_path / "r", tmp_path / "c")
    times = [frame.time for frame in made.frames]
    assert len(times) == 3 and times == sorted(times)
    assert "an image is named again, and counts once" in caplog.text


def transposed_log(text: str) -> str:
    lines = text.splitlines()
    for n in range(1, len(lines), 5):
        rows = np.array([line.split() for line in lines[n : n + 4]])
        lines[n : n + 4] = map(" ".join, rows.T.tolist())
    return "\n".join(lines)


def transposed_camera(text: str) -> str:
    camera = json.loads(text)
    camera["intrinsic_matrix"] = np.reshape(camera["intrinsic_matrix"], (3, 3)).T.ravel().tolist()
    return json.dumps(camera)


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        ("trajectory.log", transposed_log, "its last row is .* written by columns. Transpose it"),
        ("camera_intrinsic.json", transposed_camera, "^recording '.*expected a matrix .*fx, 0, cx"),
    ],
)
def test_matrices_by_columns_are_refused(
    capture: Capture, tmp_path: Path, name: str, change: Callable[[str], str], message: str
) -> None:
    export_capture(capture, "redwood", tmp_path / "r")
    edited(tmp_path / "r" / name, change)
    with pytest.raises(CaptureError, match=message):
        converted("redwood", tmp_path / "r", tmp_path / "c")


@pytest.mark.parametrize("width", [7, 9])
def test_rows_of_another_length_are_refused(capture: Capture, tmp_path: Path, width: int) -> None:
    export_capture(capture, "tum", tmp_path / "r")
    row = " ".join(map(str, range(width)))
    (tmp_path / "r/groundtruth.txt").write_text(f"{row}\n" * 8)  # as many numbers as rows of 8 have
    with pytest.raises(CaptureError, match=f"{width} in the first line"):
        read_recording(tmp_path / "r", "tum")
    edited(tmp_path / "r/rgb.txt", lambda s: s.replace(" rgb/", " my rgb/"))
    (tmp_path / "r/groundtruth.txt").write_text("0 1 2 3 0 0 0 1 # here\n")
    (tmp_path / "r/rgb").rename(tmp_path / "r/my rgb")
    assert len(read_recording(tmp_path / "r", "tum").frames) == 3


@pytest.mark.parametrize("prefix", ["", "../images/", "{}/images/"])
def test_names_of_colmap_stay_below_the_images_and_are_in_the_order_of_people(
    capture: Capture, tmp_path: Path, caplog, prefix: str
) -> None:
    folder = tmp_path / "colmap"
    export_capture(capture, "colmap-text", folder)
    expected = converted("colmap", folder, tmp_path / "plain")
    edited(folder / "sparse/0/cameras.txt", lambda s: s.replace(" 21 14 ", " 21.0 14.0 "))
    for number in (0, 1, 2):
        old, new = f"000{number}.png", f"{8 + number}.png"
        (folder / "images" / old).rename(folder / "images" / new)
        (folder / "masks" / f"{old}.png").rename(folder / f"masks/{new}.png")
        named = re.sub(old, prefix.format(folder) + new, (folder / IMAGES).read_text())
        (folder / IMAGES).write_text(named)
    (folder / "sparse/0/points3D.ply").write_text("ply")
    found = converted("colmap", folder, tmp_path / "c")
    for frame, true in zip(found.frames, expected.frames, strict=True):
        np.testing.assert_array_equal(frame.load_image(), true.load_image())
        np.testing.assert_array_equal(frame.load_mask(), true.load_mask())
        np.testing.assert_array_equal(frame.camera.world_from_cam, true.camera.world_from_cam)
    assert "points in the format of other programs" in caplog.text
    for name in ("cameras", "images"):
        (folder / f"sparse/0/{name}.bin").write_bytes(bytes(8))
    with pytest.raises(CaptureError, match="no images"):
        read_recording(folder, "colmap")
    export_capture(capture, "colmap", tmp_path / "both")
    for path in (folder / "sparse/0").glob("*.txt"):
        shutil.copy(path, tmp_path / "both/sparse/0")
    converted("colmap", tmp_path / "both", tmp_path / "b")
    assert "the binary model is read, not the text beside it" in caplog.text


def test_the_first_object_of_bop_is_the_same_in_all_images(
    capture: Capture, tmp_path: Path
) -> None:
    export_capture(capture, "bop", tmp_path / "r")
    scene = tmp_path / "r/train/000000"
    (scene / "rgb").rename(scene / "gray")  # as ITODD has it
    cameras, objects = (
        json.loads((scene / f"scene_{n}.json").read_text()) for n in ("camera", "gt")
    )
    for camera in cameras.values():
        del camera["cam_R_w2c"], camera["cam_t_w2c"]
    other = {"obj_id": 7, "cam_R_m2c": np.eye(3).ravel().tolist(), "cam_t_m2c": [0, 0, 900]}
    objects |= {"1": [other, *objects["1"]], "2": [other]}
    for folder in ("mask", "mask_visib"):
        (scene / folder / "000001_000000.png").rename(scene / folder / "000001_000001.png")
    for name, content in (("camera", cameras), ("gt", objects)):
        (scene / f"scene_{name}.json").write_text(json.dumps(content))
    found = converted("bop", tmp_path / "r", tmp_path / "c")
    assert len(found) == 2
    for frame, true in zip(found.frames, capture.frames[:2], strict=True):
        pose = true.camera.world_from_cam
        np.testing.assert_allclose(frame.camera.world_from_cam, pose, atol=1e-6)
        np.testing.assert_array_equal(frame.load_mask() > 127, true.load_mask() > 127)
