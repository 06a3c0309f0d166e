"""What is no scene: found where it is certain, marked by the user, and neither trained nor scored."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.images import write_image
from digs_warp.data.layers import Layer
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.init.config import InitConfig
from digs_warp.masks.config import SegmentConfig
from digs_warp.masks.no_scene import WIDER, without_no_scene
from digs_warp.pipeline.reconstruct import ReconstructConfig, reconstruct
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.train.config import Stop, TrainConfig
from reference.tiny_capture import write_tiny_capture

BORDER = 6


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    """A ball before a wall whose brightness changes from frame to frame, and no masks."""
    capture = write_tiny_capture(tmp_path_factory.mktemp("room") / "capture", frames=12)
    frames = []
    for number, frame in enumerate(capture.frames):
        image = frame.load_image()
        image[frame.load_mask() < 128] = 90 + number
        depth = np.nan_to_num(frame.load_depth(), nan=2.0)
        frame = frame.with_layer(Layer.IMAGE, image).with_layer(Layer.DEPTH, depth)
        frames.append(frame.without_layer(Layer.MASK))
    return replace(capture, frames=tuple(frames))


def changed(capture: Capture, blacken) -> Capture:
    """The recording with images that a function of number and image has changed."""
    frames = []
    for number, frame in enumerate(capture.frames):
        image = frame.load_image()
        blacken(number, image)
        frames.append(frame.with_layer(Layer.IMAGE, image))
    return replace(capture, frames=tuple(frames))


def bordered(number: int, image: np.ndarray) -> None:
    inner = image[:, BORDER:-BORDER].copy()
    image[...] = np.random.default_rng(number).integers(0, 6, image.shape)  # as JPEG has it
    image[:, BORDER:-BORDER] = inner


def before_black(number: int, image: np.ndarray) -> None:
    image[(image == 90 + number).all(axis=2)] = 0


def at_night(number: int, image: np.ndarray) -> None:
    image[: 20 + number % 5] = 3


def test_a_black_border_is_found_and_said_once(
    room: Capture, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    found = without_no_scene(changed(room, bordered), None, tmp_path)
    unknown = found.frames[0].load_unknown()
    assert unknown is not None
    reach = BORDER + WIDER
    assert unknown[:, :reach].all() and unknown[:, -reach:].all()
    assert not unknown[:, reach:-reach].any()
    assert np.isnan(found.frames[0].load_depth()[:, :reach]).all()
    assert len(caplog.records) == 1 and "black border" in caplog.text


@pytest.mark.parametrize("blacken", [before_black, at_night, lambda number, image: None])
def test_what_is_only_dark_is_scene(room: Capture, tmp_path: Path, blacken) -> None:
    capture = changed(room, blacken)
    assert without_no_scene(capture, None, tmp_path) is capture


def test_a_mask_of_another_size_is_refused(room: Capture, tmp_path: Path) -> None:
    write_image(tmp_path / "marked.png", np.zeros((5, 5), np.uint8))
    with pytest.raises(DigsError, match="5x5 pixels, expected 72x54"):
        without_no_scene(room, tmp_path / "marked.png", tmp_path)


CONFIG = ReconstructConfig(
    init=InitConfig(voxel_size=0.02),
    train=TrainConfig(stop=Stop(iterations=40), sh_degree=0, evaluate_at=()),
)


def test_what_the_user_marks_is_neither_trained_nor_scored(room: Capture, tmp_path: Path) -> None:
    """A stick that moves with the camera would else be trained as scene, and lower the scores."""

    def with_stick(number: int, image: np.ndarray) -> None:
        image[30:, 30:40] = [255, 0, 255]

    marked = np.zeros((54, 72), np.uint8)
    marked[28:, 28:42] = 255
    write_image(tmp_path / "marked.png", marked)
    config = replace(CONFIG, segment=SegmentConfig(ignore_mask=tmp_path / "marked.png"))
    scores = {}
    for name, capture in (("clean", room), ("stick", changed(room, with_stick))):
        result = reconstruct(capture, config, tmp_path / name)
        scores[name] = result.scores.mean.psnr_frame
        assert result.poses.subject == "scene"
    assert scores["stick"] == pytest.approx(scores["clean"], abs=0.1)
    with_it = reconstruct(changed(room, with_stick), CONFIG, tmp_path / "with it")
    assert with_it.scores.mean.psnr_frame < scores["stick"] - 1.0

    read = Reconstruction.load(tmp_path / "stick", room)
    assert read.frames is not None
    for frames in (read.frames, read.in_memory().frames):
        assert isinstance(frames, PosedFrames)
        np.testing.assert_array_equal(frames.held_out[0].load_unknown(), marked > 0)
