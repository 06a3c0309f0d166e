"""Mask sources, from frames to files: what is written, and refused."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.data.images import read_image, write_image
from digs_warp.data.layers import Layer
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.masks.config import SegmentConfig
from digs_warp.masks.masks import masked, segment
from reference.tiny_capture import HEIGHT, WIDTH, write_tiny_capture


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory) -> list[Frame]:
    return list(write_tiny_capture(tmp_path_factory.mktemp("masks") / "capture", frames=4).frames)


def masks_of(paths: list[Path]) -> list[np.ndarray]:
    return [read_image(path)[..., 0] for path in paths]


def test_the_recordings_masks_are_taken_as_they_are(frames: list[Frame], tmp_path: Path) -> None:
    paths = segment(frames, SegmentConfig(), tmp_path / "masks")
    assert paths == [frame.path(Layer.MASK) for frame in frames]
    assert not (tmp_path / "masks").exists()


def test_held_out_frames_without_masks_get_some(frames: list[Frame], tmp_path: Path) -> None:
    bare = tuple(frame.without_layer(Layer.MASK) for frame in frames)
    found = masked(PosedFrames(bare[:3], bare[3:]), SegmentConfig(masks="depth"), tmp_path)
    assert found.held_out[0].load_mask().max() == 255


# A folder of masks


def in_folder(frames: list[Frame], folder: Path, pixels: np.ndarray) -> SegmentConfig:
    for frame in frames:
        write_image(folder / f"{frame.name}.png", pixels)
    return SegmentConfig(masks="folder", mask_folder=folder)


SOFT = np.linspace(0, 255, HEIGHT * WIDTH).astype(np.uint8).reshape(HEIGHT, WIDTH)


@pytest.mark.parametrize(
    "pixels",
    [
        SOFT,
        np.repeat(SOFT[..., None], 3, axis=2),
        np.dstack([SOFT[::-1], SOFT[::-1], SOFT[::-1], SOFT]),
        SOFT.astype(np.uint16) * 257,
    ],
    ids=["gray", "RGB", "cut-out", "16 bits"],
)
def test_masks_of_a_folder_come_in_many_forms(
    frames: list[Frame], tmp_path: Path, pixels: np.ndarray
) -> None:
    config = in_folder(frames, tmp_path / "theirs", pixels)
    for found in masks_of(segment(frames, config, tmp_path / "ours")):
        np.testing.assert_array_equal(found, SOFT)


def test_masks_of_a_folder_may_be_numbers_with_other_names(
    frames: list[Frame], tmp_path: Path
) -> None:
    numbers = (3 * (SOFT > 127)).astype(np.uint8)
    config = in_folder(frames, tmp_path / "theirs", np.dstack([numbers] * 3))
    for frame in frames:
        path = tmp_path / f"theirs/{frame.name}.png"
        path.rename(path.with_name(f"{frame.name}_mask.PNG"))
    for found in masks_of(segment(frames, config, tmp_path / "ours")):
        np.testing.assert_array_equal(found, 255 * (SOFT > 127))


def test_a_mask_of_another_size_is_refused(frames: list[Frame], tmp_path: Path) -> None:
    config = in_folder(frames, tmp_path / "theirs", SOFT[:, :40])
    with pytest.raises(
        DigsError, match=f"0000.png': 40x{HEIGHT} pixels, expected {WIDTH}x{HEIGHT}"
    ):
        segment(frames, config, tmp_path / "ours")


def test_missing_masks_are_counted_and_named(frames: list[Frame], tmp_path: Path) -> None:
    config = in_folder(frames, tmp_path / "theirs", SOFT)
    for number in (1, 3):
        (tmp_path / "theirs" / f"{number:04d}.png").unlink()
    with pytest.raises(DigsError, match=r"lacks the masks of 2 of 4 frames.*'0001\.png'"):
        segment(frames, config, tmp_path / "ours")


@pytest.mark.parametrize(("value", "word"), [(0, "empty"), (255, "full")])
def test_odd_masks_are_pointed_out(
    frames: list[Frame], tmp_path: Path, value: int, word: str, caplog: pytest.LogCaptureFixture
) -> None:
    config = in_folder(frames, tmp_path / "theirs", np.full((HEIGHT, WIDTH), value, np.uint8))
    segment(frames, config, tmp_path / "ours")
    assert f"4 of 4 are almost {word} (the first is '0000')" in caplog.text


# Settings and frames that do not go together


def test_a_frame_without_depth_needs_another_source(frames: list[Frame], tmp_path: Path) -> None:
    bare = [*frames[:3], replace(frames[3], layers={Layer.IMAGE: frames[3].path(Layer.IMAGE)})]
    with pytest.raises(DigsError, match=r"1 of 4 frames have no 'depth_file_path'.*'0003'"):
        segment(bare, SegmentConfig(masks="depth"), tmp_path)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"masks": "folder"}, "--mask-folder"),
        ({"mask_folder": Path("x")}, "--mask-folder"),
    ],
)
def test_settings_that_contradict_each_other_are_refused(settings: dict, message: str) -> None:
    with pytest.raises(DigsError, match=message):
        SegmentConfig(**settings)
