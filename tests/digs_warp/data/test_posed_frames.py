"""The cameras and masks that a reconstruction used, and masks as run lengths, come back as they were."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.layers import Layer
from digs_warp.data.objects import mask_of_text, text_of_mask
from digs_warp.data.posed_frames import CAMERAS, PosedFrames
from reference.tiny_capture import write_tiny_capture

Posed = tuple[Capture, PosedFrames, Path]


@pytest.fixture
def posed(tmp_path: Path) -> Posed:
    """A capture, the frames with one camera moved and one mask replaced, and the folder they lie in."""
    capture = write_tiny_capture(tmp_path / "capture", frames=4)
    training, held_out = capture.split(2)
    moved = training[0].camera.world_from_cam.copy()
    moved[:3, 3] += 0.25
    mask = tmp_path / "reconstruction" / "masks" / "a.png"
    camera = replace(training[0].camera, world_from_cam=moved)
    training[0] = replace(training[0], camera=camera).with_layer(Layer.MASK, mask)
    frames = PosedFrames(tuple(training), tuple(held_out), sfm_per_metre=2.5)
    return capture, frames, tmp_path / "reconstruction"


def test_what_was_saved_is_read(posed: Posed) -> None:
    capture, frames, folder = posed
    frames.save(folder)
    found = PosedFrames.load(capture, folder)
    assert found.sfm_per_metre == 2.5
    for group in ("training", "held_out"):
        for a, b in zip(getattr(found, group), getattr(frames, group), strict=True):
            assert a.name == b.name
            assert a.layers == b.layers
            np.testing.assert_array_equal(a.camera.world_from_cam, b.camera.world_from_cam)


def test_the_folder_can_be_moved_and_another_capture_or_a_broken_file_is_refused(
    posed: Posed,
) -> None:
    capture, frames, folder = posed
    frames.save(folder)
    elsewhere = folder.rename(folder.with_name("elsewhere"))
    found = PosedFrames.load(capture, elsewhere)
    assert found.training[0].path(Layer.MASK) == elsewhere / "masks" / "a.png"
    with pytest.raises(DigsError, match="capture"):
        PosedFrames.load(replace(capture, frames=capture.frames[:2]), elsewhere)
    for entries, message in (
        (None, "reconstruct again"),
        ([{"name": "0000"}], "has no .*reconstruct again"),
        ([{"name": "0000", "world_from_cam": "x", "held_out": False}], "reconstruct again"),
    ):
        record = json.loads((elsewhere / CAMERAS).read_text()) | {"frames": entries}
        (elsewhere / CAMERAS).write_text(json.dumps(record))
        with pytest.raises(DigsError, match=message):
            PosedFrames.load(capture, elsewhere)


# pycocotools.mask.encode of `framed`.
FRAMED = (
    "01d<k0hC00000000000000000000000000000000000000CII77II77II77II77II77II77II77II77II77II7d000"
    "000000000000000000000000000000000000[<"
)


def framed() -> np.ndarray:
    mask = np.zeros((40, 70), bool)
    mask[5:33, 10:60] = True
    mask[20:25, 30:40] = False
    mask[0, 0] = True
    return mask


def test_the_text_is_that_of_coco() -> None:
    assert text_of_mask(framed()) == FRAMED
    np.testing.assert_array_equal(mask_of_text(FRAMED, 40, 70), framed())


def test_any_mask_comes_back_and_text_of_another_is_refused() -> None:
    for share in (0.0, 0.02, 0.5, 1.0):
        mask = np.random.default_rng(1).random((37, 211)) < share
        np.testing.assert_array_equal(mask_of_text(text_of_mask(mask), 37, 211), mask)
    for text in ("", FRAMED[:-1], "P", "~", FRAMED + "1"):
        with pytest.raises(ValueError, match=r"pixels|character|ends"):
            mask_of_text(text, 40, 70)
