"""The capture folder and its image files: exact round trips, clear errors, folders made by others."""

import json
import os
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from threading import Event

import numpy as np
import pytest

from digs_warp.checks import CaptureError, DigsError
from digs_warp.data import decoded as module
from digs_warp.data.about import About
from digs_warp.data.capture import object_alone, read_capture
from digs_warp.data.capture_writer import CaptureWriter
from digs_warp.data.decoded import decoded, decoded_once
from digs_warp.data.images import linear_from_srgb, read_image, srgb_from_linear, write_image
from digs_warp.data.layers import BASIC_LAYERS, Layer
from digs_warp.data.objects import PlacedObject, matrix_rows
from digs_warp.data.rig import UNKNOWN_EXPOSURE, CameraMotion, Exposure, InfraredPair, Rig
from reference.full_disk import largest_file
from reference.noise_capture import INTRINSICS, frame_images, view, write_capture


@pytest.mark.parametrize("stereo", [True, False])
def test_what_is_written_is_read(tmp_path: Path, stereo: bool) -> None:
    write_capture(tmp_path, 3, stereo)
    capture = read_capture(tmp_path)
    assert len(capture) == 3
    assert capture.rig == (Rig(0.12) if stereo else None)
    assert capture.about.recorded_as == "a test"
    for number, frame in enumerate(capture.frames):
        images = frame_images(number, stereo)
        assert frame.name == f"{number:04d}"
        assert frame.time == 0.5 * number
        assert frame.camera.intrinsics == INTRINSICS
        np.testing.assert_allclose(frame.camera.world_from_cam, view(number), atol=1e-15)
        np.testing.assert_array_equal(frame.load_image(), images.image)
        np.testing.assert_array_equal(frame.load_depth(), images.depth)
        np.testing.assert_array_equal(frame.load_mask(), images.mask)
        if stereo:
            assert images.right is not None
            assert images.depth_true is not None
            np.testing.assert_array_equal(frame.load_right_image(), images.right)
            np.testing.assert_array_equal(frame.load_depth_true(), images.depth_true)


def test_facts_about_the_recording_come_back(tmp_path: Path) -> None:
    at_origin = matrix_rows(np.eye(4))
    about = About(
        recorded_as="zed", poses_known=False, tier="guided", seed=3, object_radius=0.2,
        world_from_mesh=((0.0, -2.0, 0.0, 1.0), (2.0, 0.0, 0.0, 0.0), (0.0, 0.0, 2.0, 5.0),
                         (0.0, 0.0, 0.0, 1.0)),
        surround_radius=4, ground="table", exposure=1.5, sensor={"baseline": 0.12, "max_depth": None},
        readout_time=0.01, effects=("blur",), cause_labels={0: "ok", 12: "occluded"},
        objects=(PlacedObject("mug", (0.1, 0.2, 0.3), at_origin, "a/mug.glb"),
                 PlacedObject("made by code", (1.0, 1.0, 1.0), at_origin)),
    )  # fmt: skip
    writer = CaptureWriter(tmp_path, INTRINSICS)
    writer.write_frame(0, frame_images(0))
    writer.add_pose(0, view(0), time=0.0)
    assert writer.finish(about).about == about


LABELS = (
    *(Layer.DEPTH_RIGHT, Layer.MASK_RIGHT, Layer.DISPARITY, Layer.DISPARITY_RIGHT),
    *(Layer.INSTANCES, Layer.OCCLUSION, Layer.OCCLUSION_RIGHT, Layer.FLOW, Layer.FLOW_OCCLUSION),
)


def test_arrays_and_files_of_every_layer_give_the_same_pixels(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    gray = rng.integers(0, 256, (9, 12), dtype=np.uint8)
    normals = rng.normal(size=(9, 12, 3)).astype(np.float32)
    images = replace(frame_images(0), cause=gray, confidence=gray, normals=normals)
    images = images.with_layers({layer: gray for layer in LABELS if layer.pattern.endswith("png")})
    numbers = [layer for layer in LABELS if layer.pattern.endswith("exr")]
    images = images.with_layers(dict.fromkeys(numbers, normals[..., 0]))
    images = images.with_layers({Layer.FLOW: normals})
    assert images.depth is not None
    images.depth[0, :5] = [np.nan, -np.inf, np.inf, 0.0, -1.0]
    writer = CaptureWriter(tmp_path, INTRINSICS)
    writer.write_frame(0, images)
    writer.write_frame(1, frame_images(1))
    assert [writer.has_frame(n, (*BASIC_LAYERS, Layer.CAUSE)) for n in (0, 1)] == [True, False]
    writer.add_pose(0, view(0), time=0.0)
    other = replace(INTRINSICS, fx=7.0)
    writer.add_pose(1, view(1), time=1.0, intrinsics=other)
    on_disk, plain = writer.finish().frames
    assert (on_disk.camera.intrinsics, plain.camera.intrinsics) == (INTRINSICS, other)
    in_memory = replace(on_disk, layers=images.by_layer())
    for layer in (*BASIC_LAYERS, Layer.CAUSE, Layer.CONFIDENCE, Layer.NORMALS, *LABELS):
        expected, found = on_disk.load(layer), in_memory.load(layer)
        assert expected.dtype == found.dtype
        np.testing.assert_array_equal(found, expected)
        found[:] = 0  # the caller's own: the frame keeps its pixels
        np.testing.assert_array_equal(in_memory.load(layer), expected)
    np.testing.assert_array_equal(on_disk.load_cause(), gray)
    np.testing.assert_array_equal(np.round(255 * on_disk.load_confidence()), gray)
    np.testing.assert_array_equal(on_disk.load(Layer.NORMALS), normals)
    # Codes of the sensor survive in the file and read as unknown.
    np.testing.assert_array_equal(read_image(on_disk.path(Layer.DEPTH))[..., 0], images.depth)
    assert np.isnan(on_disk.load_depth()[0, :5]).all()
    with pytest.raises(CaptureError, match="the capture has no 'confidence_file_path'"):
        plain.load_confidence()


def test_frames_may_be_written_in_any_order_and_resumed(tmp_path: Path) -> None:
    writer = CaptureWriter(tmp_path, INTRINSICS)
    writer.write_frame(2, frame_images(2))
    writer.write_frame(0, frame_images(0))
    assert [writer.has_frame(number) for number in range(3)] == [True, False, True]
    (tmp_path / "masks/0002.png").unlink()
    assert not writer.has_frame(2)

    again = CaptureWriter(tmp_path, INTRINSICS)
    for number in (2, 1, 0):
        if not again.has_frame(number):
            again.write_frame(number, frame_images(number))
        again.add_pose(number, view(number), time=float(number))
    assert [frame.name for frame in again.finish().frames] == ["0000", "0001", "0002"]


def test_the_middle_of_every_eight_frames_is_held_out(tmp_path: Path) -> None:
    capture = write_capture(tmp_path, 25, stereo=False)
    for count, every, held_out in (
        *((16, 8, [4, 12]), (10, 8, [2, 7]), (25, 8, [3, 9, 15, 21])),
        *((2, 8, [1]), (3, 2, [0, 2])),
    ):
        train, test = replace(capture, frames=capture.frames[:count]).split(every)
        assert [int(frame.name) for frame in test] == held_out
        assert sorted(int(frame.name) for frame in [*train, *test]) == list(range(count))


def test_an_object_alone_has_nothing_around_it(tmp_path: Path) -> None:
    capture = write_capture(tmp_path, 1)
    (frame,), (alone,) = capture.frames, object_alone(capture).frames
    inside = frame.load_mask() > 127
    np.testing.assert_array_equal(alone.load_image()[inside], frame.load_image()[inside])
    assert len(np.unique(alone.load_image()[~inside], axis=0)) == 1
    np.testing.assert_array_equal(alone.load_depth()[inside], frame.load_depth()[inside])
    assert np.isnan(alone.load_depth()[~inside]).all()


def test_an_infrared_pair_comes_back_and_is_no_right_image(tmp_path: Path) -> None:
    pair = InfraredPair(0.015, 20.0, 21.0, 6.0, 4.5)
    writer = CaptureWriter(tmp_path, INTRINSICS, Rig(0.05, pair))
    gray = np.random.default_rng(1).integers(0, 256, (2, 9, 12), dtype=np.uint8)
    images = replace(frame_images(0), infrared_left=gray[0], infrared_right=gray[1])
    writer.write_frame(0, images)
    writer.add_pose(0, view(0), time=0.0)
    capture = writer.finish()
    assert capture.rig == Rig(0.05, pair) and capture.right_offset is None
    np.testing.assert_array_equal(capture.frames[0].load_infrared(), gray)
    index = json.loads((tmp_path / "transforms.json").read_text())
    del index["digs_warp"]["rig"]["infrared"]
    (tmp_path / "transforms.json").write_text(json.dumps(index))
    assert read_capture(tmp_path).right_offset == 0.05


def test_motion_and_exposure_of_a_frame_come_back(tmp_path: Path) -> None:
    moving = Exposure(CameraMotion((0.1, -0.2, 0.3), (1.0, 0.0, -2.5)), 0.01)
    for exposure in (UNKNOWN_EXPOSURE, Exposure(exposure_time=0.0), moving):
        for folder in (tmp_path, None):
            writer = CaptureWriter(folder, INTRINSICS)
            writer.write_frame(0, frame_images(0))
            writer.add_pose(0, view(0), time=0.0, exposure=exposure)
            assert writer.finish().frames[0].exposure == exposure


def random_pixels(dtype: str, shape: tuple[int, ...]) -> np.ndarray:
    rng = np.random.default_rng(0)
    if dtype == "float32":
        return rng.normal(size=shape).astype(np.float32)
    return rng.integers(0, np.iinfo(dtype).max + 1, shape).astype(dtype)


def test_pixels_that_are_written_are_read(tmp_path: Path) -> None:
    for dtype, shape in (
        *(("uint8", (1, 1)), ("uint8", (16, 33, 4)), ("uint16", (7, 5)), ("uint16", (7, 5, 3))),
        *(("float32", (7, 5)), ("float32", (16, 33, 4))),
    ):
        pixels = random_pixels(dtype, shape)
        image_path = tmp_path / "new_folder" / ("x.exr" if dtype == "float32" else "x.png")
        write_image(image_path, pixels)  # colors of transparent pixels survive
        found = read_image(image_path)
        assert found.dtype == pixels.dtype
        np.testing.assert_array_equal(found, pixels.reshape(*shape[:2], -1))


def test_exr_keeps_nan_infinity_and_tiny_values(tmp_path: Path) -> None:
    depth = np.array([[np.nan, np.inf, -np.inf], [0.0, 1e-38, 12345.678]], dtype=np.float32)
    write_image(tmp_path / "depth.exr", depth)
    np.testing.assert_array_equal(read_image(tmp_path / "depth.exr")[..., 0], depth)


def test_16_bit_files_carry_no_gamma(tmp_path: Path) -> None:
    """They hold depth; readers that honor the PNG's color space would bend it."""
    write_image(tmp_path / "depth.png", random_pixels("uint16", (6, 8)))
    data = (tmp_path / "depth.png").read_bytes()
    assert b"IHDR" in data and b"gAMA" not in data and b"sRGB" not in data


def test_files_that_are_truncated_missing_empty_or_foreign_are_named(tmp_path: Path) -> None:
    for name, share in (
        *(("x.png", 0.1), ("x.png", 0.9)),
        *(("x.exr", 0.1), ("x.exr", 0.5), ("x.exr", 0.9)),
    ):
        image_path = tmp_path / name
        write_image(
            image_path, random_pixels("uint8" if name == "x.png" else "float32", (64, 64, 3))
        )
        data = image_path.read_bytes()
        image_path.write_bytes(data[: int(share * len(data))])
        with pytest.raises(DigsError, match=rf"thing '.*{name}'"):
            read_image(image_path, "thing")
    (tmp_path / "empty.png").touch()
    (tmp_path / "text.png").write_text("not an image at all")
    for name, message in (
        *(("gone.png", "gone.png': no such file"), ("empty.png", "empty.png': the file is empty")),
        *(("text.png", "text.png': cannot be opened"), ("", "found a folder")),
    ):
        with pytest.raises(DigsError, match=message):
            read_image(tmp_path / name)


def test_the_same_pixels_give_the_same_bytes_at_any_time(tmp_path: Path) -> None:
    for image_path, dtype in ((tmp_path / "x.png", "uint8"), (tmp_path / "x.exr", "float32")):
        pixels = random_pixels(dtype, (9, 7, 3))
        write_image(image_path, pixels)
        before = image_path.read_bytes()
        time.sleep(1.1)  # dates in image files count in seconds
        write_image(image_path, pixels)
        assert image_path.read_bytes() == before


def test_an_image_that_does_not_fit_on_the_disk_leaves_the_old_one(tmp_path: Path) -> None:
    for name, dtype in (("x.png", "uint8"), ("x.png", "uint16"), ("x.exr", "float32")):
        image_path = tmp_path / name
        pixels = random_pixels(dtype, (40, 30, 3))
        write_image(image_path, pixels)
        before = image_path.read_bytes()
        for size in (0, 1, 100, len(before) // 2, len(before) - 20, len(before) - 1):
            with largest_file(size), pytest.raises(DigsError, match=rf"{name}': cannot be written"):
                write_image(image_path, pixels)
            assert image_path.read_bytes() == before
            assert list(tmp_path.iterdir()) == [image_path]
        image_path.unlink()


def test_srgb_curves_undo_each_other_and_meet_known_values() -> None:
    values = np.linspace(0, 1, 1001)
    np.testing.assert_allclose(linear_from_srgb(srgb_from_linear(values)), values, atol=1e-7)
    np.testing.assert_allclose(srgb_from_linear(np.array([0.0, 1.0])), [0, 1], atol=1e-12)
    # 18 % gray is 117.6 of 255 (IEC 61966-2-1).
    assert 255 * srgb_from_linear(np.array(0.18)) == pytest.approx(117.6, abs=0.05)


IMAGE = np.arange(24, dtype=np.uint8).reshape(2, 4, 3)


@pytest.fixture
def image_path(tmp_path: Path) -> Path:
    write_image(tmp_path / "image.png", IMAGE)
    return tmp_path / "image.png"


def counting() -> tuple[Callable[[Path], np.ndarray], list[Path]]:
    """Return a function that reads an image, and the files that it has read."""
    files: list[Path] = []

    def read(image_path: Path) -> np.ndarray:
        files.append(image_path)
        return read_image(image_path)

    return read, files


def test_a_file_is_decoded_once_and_each_caller_has_its_own_pixels(image_path: Path) -> None:
    read, files = counting()
    with decoded_once():
        for _ in range(3):
            with decoded_once():
                pass  # drops nothing of the block around it
            pixels = decoded(image_path, read)
            np.testing.assert_array_equal(pixels, IMAGE)
            pixels[:] = 0
    assert files == [image_path]


def test_a_file_that_changed_is_read_again(image_path: Path) -> None:
    with decoded_once():
        image_path.write_bytes(b"before")
        decoded(image_path, lambda each: np.fromfile(each, np.uint8))
        image_path.write_bytes(b"after!")
        os.utime(image_path, ns=(0, 0))  # as if it were written at another time
        assert decoded(image_path, lambda each: np.fromfile(each, np.uint8)).tobytes() == b"after!"


def test_no_more_is_kept_than_there_is_memory(image_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(module, "MEMORY", IMAGE.nbytes)
    other = image_path.with_name("other.png")
    write_image(other, IMAGE)
    read, files = counting()
    with decoded_once():
        for each in (image_path, other, image_path, other):
            decoded(each, read)
    assert files == [image_path, other, other]


def test_threads_wait_for_the_one_that_decodes_the_file(image_path: Path) -> None:
    read, files = counting()
    begun, go_on = Event(), Event()

    def slowly(image_path: Path) -> np.ndarray:
        begun.set()
        assert go_on.wait(120)
        return read(image_path)

    with decoded_once(), ThreadPoolExecutor(2) as pool:
        first = pool.submit(decoded, image_path, slowly)
        assert begun.wait(120)
        second = pool.submit(decoded, image_path, read)
        go_on.set()
        np.testing.assert_array_equal(first.result(), second.result())
    assert files == [image_path]
