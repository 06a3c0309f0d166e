"""A network's mask is only believed where the depth has a foreground."""

from pathlib import Path

import numpy as np

from digs_warp.data.images import read_image
from digs_warp.masks.config import SegmentConfig
from digs_warp.masks.masks import segment
from digs_warp.masks.network import mask_in_foreground
from reference.ball_capture import ball_view, ball_views, write_capture
from reference.overlap import intersection_over_union
from reference.tiny_network import write_network

IMAGES = ball_view(0.3)[1]
IMAGE, DEPTH, TRUTH = IMAGES.image, IMAGES.depth, IMAGES.mask


def test_a_network_that_takes_everything_is_held_to_the_foreground() -> None:
    found = mask_in_foreground(lambda image: np.full(image.shape[:2], 255, np.uint8), IMAGE, DEPTH)
    assert intersection_over_union(found, TRUTH) > 0.9


def test_a_network_that_finds_nothing_is_not_believed() -> None:
    found = mask_in_foreground(lambda image: np.zeros(image.shape[:2], np.uint8), IMAGE, DEPTH)
    assert intersection_over_union(found, TRUTH) > 0.9


def test_the_network_decides_inside_the_foreground_and_sees_only_its_surroundings() -> None:
    seen = []

    def upper_part(image: np.ndarray) -> np.ndarray:
        seen.append(image.shape)
        mask = np.full(image.shape[:2], 255, np.uint8)
        mask[round(0.7 * len(mask)) :] = 0
        return mask

    found = mask_in_foreground(upper_part, IMAGE, DEPTH)
    rows, columns = np.nonzero(TRUTH)
    assert np.ptp(rows) < seen[0][0] < len(TRUTH) and np.ptp(columns) < seen[0][1] < TRUTH.shape[1]
    assert (
        found[rows.max() - 2 :].max() == 0 and found[rows.min() + 5, round(columns.mean())] == 255
    )


def test_without_a_foreground_the_mask_is_empty() -> None:
    blind = np.full_like(DEPTH, np.nan)
    found = mask_in_foreground(lambda image: np.full(image.shape[:2], 255, np.uint8), IMAGE, blind)
    assert found.shape == TRUTH.shape and not found.any()


def test_masks_of_network_and_depth_are_written(tmp_path: Path) -> None:
    frames = write_capture(tmp_path / "capture", ball_views(2)).frames
    model = write_network(tmp_path / "net.onnx")
    config = SegmentConfig(masks="isnet+depth", mask_model=model)
    for path, frame in zip(segment(frames, config, tmp_path / "m"), frames, strict=True):
        found, truth = read_image(path)[..., 0], frame.load_mask()
        assert found.shape == truth.shape and found.any()
        assert found[truth == 0].mean() < 20  # the network marks all that is red; the wall is white
