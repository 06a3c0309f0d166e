"""FLIP, where the extra is installed."""

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.measure.flip import flip

pytest.importorskip("flip_evaluator", reason="flip-evaluator is not installed")


def image(seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).random((40, 50, 3))


def test_black_and_white_differ_almost_fully() -> None:
    black, white = np.zeros((40, 40, 3)), np.ones((40, 40, 3))
    assert flip(black, white) == pytest.approx(0.967, abs=0.01)


def test_the_mask_chooses_pixels_of_the_map() -> None:
    other = image()
    other[:, 25:] = image(2)[:, 25:]
    mask = np.zeros((40, 50), bool)
    mask[:, :10] = True
    shares = 0.2 * flip(other, image(), mask) + 0.8 * flip(other, image(), ~mask)
    assert flip(other, image()) == pytest.approx(shares)
    assert flip(other, image(), mask) < 0.1 * flip(other, image(), ~mask)
    assert np.isnan(flip(other, image(), np.zeros((40, 50), bool)))


def test_images_of_other_shapes_are_refused() -> None:
    with pytest.raises(DigsError, match="target"):
        flip(image(), image()[:10])
