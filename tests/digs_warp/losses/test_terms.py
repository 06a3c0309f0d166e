"""The depth term and its gradient against a float64 twin; test_ssim has the photometric one."""

from collections.abc import Callable

import numpy as np
import pytest
import warp as wp
from numpy.testing import assert_allclose, assert_array_equal

from digs_warp.device.image_planes import ImagePlanes
from digs_warp.losses.depth import DepthLoss, DepthTarget, depth_weights

WIDTH, HEIGHT = 70, 20
EVERYTHING = (0, 0, WIDTH, HEIGHT)


def planes(values: np.ndarray) -> ImagePlanes:
    return ImagePlanes.of(np.atleast_3d(values))


def slope(function: Callable[[np.ndarray], float], at: np.ndarray, index: tuple) -> float:
    """Central difference in one value."""
    step = np.zeros(at.shape)
    step[index] = 1e-5
    return (function(at + step) - function(at - step)) / 2e-5


def some_indices(rng: np.random.Generator, shape: tuple[int, ...]) -> list[tuple[int, ...]]:
    return [tuple(int(rng.integers(n)) for n in shape) for _ in range(15)]


@pytest.mark.parametrize(
    ("box", "bias"), [(EVERYTHING, 0.0), ((3, 2, 61, 17), 0.0), (EVERYTHING, -0.05)]
)
def test_depth(box: tuple[int, int, int, int], bias: float) -> None:
    rng = np.random.default_rng(3)
    measured = rng.uniform(0.5, 1.5, (HEIGHT, WIDTH)).astype(np.float32)
    rendered = (measured * rng.uniform(0.9, 1.1, measured.shape)).astype(np.float32)
    alpha = rng.uniform(size=measured.shape).astype(np.float32)
    bytes_ = rng.integers(0, 256, measured.shape).astype(np.uint8)
    bytes_[rng.uniform(size=measured.shape) < 0.3] = 0
    inside = (slice(box[1], box[3]), slice(box[0], box[2]))
    weights = np.zeros_like(measured, dtype=np.float64)
    weights[inside] = bytes_[inside] / 255.0
    depths = np.stack([rendered, np.zeros_like(rendered)], axis=-1)  # expected, median
    adj = planes(np.full_like(measured, 9.0))
    term = DepthLoss(planes(depths), planes(1.0 - alpha), adj, weight=0.3)
    target = DepthTarget(
        wp.array(measured[inside].ravel(), dtype=float, device="cpu"),
        wp.array(bytes_[inside].ravel(), dtype=wp.uint8, device="cpu"),
        float(weights.sum()),
    )
    term.run(target, box, EVERYTHING, bias)

    def twin(values: np.ndarray) -> float:
        """Weighted mean of log(1 + |z - d| / (0.01 d)), d without its bias; uncovered pixels add nothing."""
        d = 1.0 / (1.0 / measured.astype(np.float64) - bias)
        terms = weights * np.log1p(np.abs(values - d) / (0.01 * d))
        return 0.3 * float(terms[alpha >= 0.5].sum() / weights.sum())

    assert term.value() == pytest.approx(twin(rendered), rel=1e-5)
    gradient = adj.to_numpy()[..., 0]
    for index in some_indices(rng, measured.shape):
        expected = slope(twin, rendered.astype(np.float64), index)
        assert gradient[index] == pytest.approx(expected, rel=1e-3, abs=1e-9)


def test_depth_that_is_not_finite_shows_in_the_value() -> None:
    """A training that diverges is found by the sums."""
    target = DepthTarget(
        wp.ones(WIDTH * HEIGHT, dtype=float, device="cpu"),
        wp.full(WIDTH * HEIGHT, 255, dtype=wp.uint8, device="cpu"),
        float(WIDTH * HEIGHT),
    )
    for broken in (np.nan, np.inf, -np.inf):
        rendered = np.ones((HEIGHT, WIDTH), np.float32)
        rendered[7, WIDTH - 1] = rendered[3, 5] = broken
        behind, adj = planes(np.zeros_like(rendered)), planes(np.zeros_like(rendered))
        term = DepthLoss(planes(rendered), behind, adj, weight=0.3)
        term.run(target, EVERYTHING, EVERYTHING)
        assert not np.isfinite(term.value())


def test_depth_weights_distrust_edges_missing_values_and_low_confidence() -> None:
    image = np.zeros((4, 6, 3), np.uint8)
    image[:, 3:] = 255
    mask = np.full((4, 6), 255, np.uint8)
    mask[0] = 127
    depth = np.ones((4, 6), np.float32)
    depth[1, 0] = np.nan
    confidence = np.full((4, 6), 1.0, np.float32)
    confidence[2, 0] = 0.5
    weights = depth_weights(image, mask, depth, confidence)
    assert not weights[0].any()
    assert weights[1].tolist() == [0, 255, round(255 * np.exp(-1)), 255, 255, 255]
    assert weights[2, 0] == 128
    everything = depth_weights(image, mask, np.ones((4, 6), np.float32), None)
    assert everything[1, 0] == everything[2, 0] == 255


def test_depth_weights_see_the_pixels_beside_the_mask() -> None:
    random = np.random.default_rng(0)
    image = random.integers(0, 256, (9, 12, 3)).astype(np.uint8)
    depth, everywhere = np.ones((9, 12), np.float32), np.full((9, 12), 255, np.uint8)
    mask = np.zeros_like(everywhere)
    mask[2:6, 3:9] = random.integers(0, 2, (4, 6)) * 255
    whole = depth_weights(image, everywhere, depth, None)
    assert_array_equal(depth_weights(image, mask, depth, None), np.where(mask > 0, whole, 0))
    last = image.astype(np.float64) / 255  # the last row and column repeat
    across = np.abs(np.diff(last, axis=1, append=last[:, -1:])).mean(axis=2)
    down = np.abs(np.diff(last, axis=0, append=last[-1:])).mean(axis=2)
    assert_allclose(whole, 255 * np.exp(-np.hypot(across, down)), atol=0.501)
