"""The capture folder: round trips, and folders made by others."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import CaptureError
from digs_warp.data.about import About
from digs_warp.data.capture import object_alone, read_capture
from digs_warp.data.capture_writer import CaptureWriter
from digs_warp.data.images import read_image
from digs_warp.data.layers import BASIC_LAYERS, Layer
from digs_warp.data.objects import PlacedObject, matrix_rows
from digs_warp.data.rig import UNKNOWN_EXPOSURE, CameraMotion, Exposure, InfraredPair, Rig
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
