"""What all exports have in common: lost depth, missing files, threads, and the command."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import CaptureError, DigsError
from digs_warp.commands.convert import Convert
from digs_warp.data.capture import Capture
from digs_warp.data.capture_writer import CaptureWriter, FrameImages
from digs_warp.data.images import encode_jpeg, read_image
from digs_warp.data.layers import Layer
from digs_warp.formats.captures.formats import (
    EXPORTERS,
    export_capture,
)
from digs_warp.formats.captures.frames import encode_depth
from digs_warp.record.files import read_json
from reference.exported import assert_exported_alike_twice, exported, with_last_frame, zoomed
from reference.recorded import CAMERA, HEIGHT, WIDTH

# The others need stereo pairs (test_export_stereo.py), or are read in test_training_sets.py.
OF_ONE_EYE = ["colmap", "colmap-text", "nerfstudio", "tum", "bop", "redwood"]


@pytest.mark.parametrize("form", ["tum", "redwood"])
def test_formats_of_one_camera_refuse_two(capture: Capture, form: str, tmp_path: Path) -> None:
    with pytest.raises(CaptureError, match="2 different cameras"):
        export_capture(zoomed(capture), form, tmp_path / "out")


def test_depth_that_16_bits_cannot_hold_becomes_unknown() -> None:
    depth = np.array([[np.nan, 0.0001, 1.0, 13.1068, 13.107]], dtype=np.float32)
    units, lost = encode_depth(depth, 5000.0)
    assert units.dtype == np.uint16
    np.testing.assert_array_equal(units, [[0, 0, 5000, 65534, 0]])
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
    layers = {k: v for k, v in capture.frames[-1].layers.items() if k != Layer.DEPTH}
    bare = with_last_frame(capture, layers=layers)
    with pytest.raises(CaptureError, match="frame '0002': the capture has no 'depth_file_path'"):
        export_capture(bare, form, tmp_path / "out")


def test_poses_that_are_unknown_are_not_exported(capture: Capture, tmp_path: Path) -> None:
    lost = replace(capture, about=replace(capture.about, poses_known=False))
    for form in EXPORTERS:
        with pytest.raises(CaptureError, match="no camera poses"):
            export_capture(lost, form, tmp_path / "out")


def test_the_command_leaves_a_complete_folder_or_none(capture: Capture, tmp_path: Path) -> None:
    out = tmp_path / "out"
    message = Convert(source=capture.folder, to="tum", out=out).execute()
    assert "3 frames as tum" in message
    assert read_json(out / "run.json", "record")["settings"]["to"] == "tum"
    with pytest.raises(DigsError, match="not empty"):
        Convert(source=capture.folder, to="bop", out=out).execute()
    Convert(source=capture.folder, to="bop", out=out, overwrite=True).execute()
    assert not (out / "rgb.txt").exists() and (out / "camera.json").exists()
    bare = shutil.copytree(capture.folder, tmp_path / "bare")
    (bare / "masks/0000.png").write_bytes(b"no image")
    with pytest.raises(DigsError, match=r"masks/0000\.png"):
        Convert(source=bare, to="bop", out=tmp_path / "broken").execute()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bare", "out"]


def test_exports_do_not_depend_on_their_threads(capture: Capture, tmp_path: Path) -> None:
    for form in (*OF_ONE_EYE, "webdataset"):
        assert_exported_alike_twice(capture, form, tmp_path / form)


def test_images_of_other_types_become_png(capture: Capture, tmp_path: Path) -> None:
    frame = capture.frames[-1]
    (tmp_path / "photo.jpg").write_bytes(encode_jpeg(frame.load_image(), quality=100))
    photo = with_last_frame(capture, layers={**frame.layers, Layer.IMAGE: tmp_path / "photo.jpg"})
    folder = exported(photo, "redwood", tmp_path / "out")
    found = read_image(folder / "color/00002.png")
    np.testing.assert_array_equal(found, photo.frames[-1].load_image())
