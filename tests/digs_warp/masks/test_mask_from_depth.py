"""Masks from depth: a ball before a wall, on a table, with holes, and cases in which nothing can be told."""

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
from digs_warp.masks.from_depth import (
    connected_pieces,
    mask_from_depth,
    object_by_depth,
    without_enclosed_holes,
)
from digs_warp.masks.no_scene import WIDER, without_no_scene
from digs_warp.masks.planes import far_edge, on_or_behind_main_plane
from digs_warp.pipeline.reconstruct import ReconstructConfig, reconstruct
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.train.config import Stop, TrainConfig
from reference.tiny_capture import write_tiny_capture

HEIGHT, WIDTH = 120, 160
V, U = np.mgrid[:HEIGHT, :WIDTH].astype(np.float64)
NEAR_DISK = np.hypot(U - 75, V - 58) < 32


def photograph(inside: np.ndarray, seed: int = 0) -> np.ndarray:
    """A red object before a green surround, with noise."""
    rng = np.random.default_rng(seed)
    color = np.where(inside[..., None], [190, 60, 50], [70, 130, 80])
    return np.clip(color + rng.normal(0, 12, color.shape), 0, 255).astype(np.uint8)


def ball_before(surround: np.ndarray) -> np.ndarray:
    depth = surround.copy()
    depth[NEAR_DISK] = 0.9 - 0.1 * np.sqrt(1 - (np.hypot(U - 75, V - 58)[NEAR_DISK] / 32) ** 2)
    return depth.astype(np.float32)


WALL = np.full((HEIGHT, WIDTH), 4.0)
# A table that comes toward the camera at the bottom, seen as a plane: 1 / z is linear in the rows.
TABLE = 1.0 / (0.3 + 0.5 * V / HEIGHT)
ROUND_ROOM = 4.0 + 0.5 * np.cos(U / 25) * np.sin(V / 20)


def overlap(mask: np.ndarray) -> float:
    """The disk's intersection with a mask over their union."""
    return (NEAR_DISK & (mask > 127)).sum() / (NEAR_DISK | (mask > 127)).sum()


@pytest.mark.parametrize("surround", [WALL, TABLE, ROUND_ROOM], ids=["wall", "table", "room"])
def test_the_ball_is_found(surround: np.ndarray) -> None:
    mask = mask_from_depth(photograph(NEAR_DISK), ball_before(surround))
    assert mask.dtype == np.uint8 and mask.shape == (HEIGHT, WIDTH)
    assert overlap(mask) > 0.97


def test_colors_correct_borders_that_depth_has_wrong() -> None:
    fattened = WALL.copy().astype(np.float32)
    fattened[np.hypot(U - 75, V - 58) < 34] = 0.9
    refined = mask_from_depth(photograph(NEAR_DISK), fattened)
    assert overlap(255 * object_by_depth(fattened)) < 0.9
    assert overlap(refined) > 0.97


@pytest.mark.parametrize("share", [0.3, 0.6])
def test_missing_depth_inside_the_object_is_filled(share: float) -> None:
    depth = ball_before(WALL)
    depth[np.random.default_rng(1).random(depth.shape) < share] = np.nan
    assert overlap(mask_from_depth(photograph(NEAR_DISK), depth)) > 0.95


def test_a_hole_stays_where_one_sees_through() -> None:
    ring = NEAR_DISK & (np.hypot(U - 75, V - 58) > 12)
    near, known = ring.copy(), np.ones_like(ring)
    assert not without_enclosed_holes(near, known)[58, 75]
    known[~ring & NEAR_DISK] = False  # nothing is known there: filled
    assert without_enclosed_holes(near, known)[58, 75]


def test_the_piece_in_the_middle_wins_over_a_larger_one_at_the_border() -> None:
    depth = ball_before(WALL)
    depth[90:, :] = 0.7  # an arm that reaches into the image
    found = object_by_depth(depth)
    assert found[58, 75] and not found[110, 20]


def test_a_flat_side_of_the_object_is_no_wall() -> None:
    depth = np.full((HEIGHT, WIDTH), np.nan, np.float32)
    depth[20:100, 30:130] = 0.8  # the front of a box; of the room only a corner is known
    depth[:10, :60] = 3.0
    assert not on_or_behind_main_plane(depth)[60, 80]
    assert object_by_depth(depth)[60, 80]


@pytest.mark.parametrize(
    "depth",
    [
        np.full((HEIGHT, WIDTH), np.nan, np.float32),
        np.full((HEIGHT, WIDTH), 1.3, np.float32),
        TABLE.astype(np.float32),
    ],
    ids=["no depth", "constant", "only a table"],
)
def test_where_nothing_stands_in_front_the_mask_is_empty(depth: np.ndarray) -> None:
    assert not mask_from_depth(photograph(NEAR_DISK), depth).any()


def test_a_table_before_a_far_room_is_neither_the_object_nor_all_there_is() -> None:
    table = 1.0 / (
        0.25 + 0.9 * V / HEIGHT
    )  # inverse depth is linear in the image; 0.9 m at the near edge
    slope = 4.0 + 3.0 * U / WIDTH + 0.3 * np.sin(V / 5.0)  # no plane
    depth = np.where((V > 80) & (np.abs(U - 75) < 60), table, slope).astype(np.float32)
    depth[NEAR_DISK] = 1.08  # as far as the table under it
    noise = np.random.default_rng(0).normal(size=depth.shape)
    depth = (depth * (1 + 0.004 * noise)).astype(np.float32)
    assert 1.6 < far_edge(depth) < 4.0
    assert far_edge(np.linspace(1.0, 5.0, 10_000).reshape(100, 100)) == np.inf
    assert far_edge(np.full((4, 4), np.nan)) == np.inf
    assert overlap(mask_from_depth(photograph(NEAR_DISK), depth)) > 0.95


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


def test_pieces_end_at_jumps_of_depth() -> None:
    depth = np.array([[1.0, 1.02, 1.5, 1.0], [1.0, np.nan, 1.5, 1.51]])
    labels = connected_pieces(depth, np.isfinite(depth))
    assert labels.ravel().tolist() == [0, 0, 1, 2, 0, 3, 1, 1]
