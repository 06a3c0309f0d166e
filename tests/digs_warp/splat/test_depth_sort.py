"""The depth sort against NumPy's stable one, with depths that need one round of two digits, and two."""

import numpy as np
import warp as wp

from digs_warp.splat.depth_sort import HISTOGRAM, depth_sort_kernel


def sort(depths: np.ndarray, drawn: np.ndarray) -> np.ndarray:
    """Return the numbers of the drawn splats, nearest first."""
    count = len(depths)
    order = wp.zeros(max(count, 1), dtype=wp.vec2i, device="cpu")
    size = wp.zeros(1, dtype=int, device="cpu")
    wp.launch(
        depth_sort_kernel,
        dim=1,
        inputs=[
            0,
            count,
            wp.array(depths, dtype=float, device="cpu"),
            wp.array(drawn, dtype=int, device="cpu"),
            wp.zeros(HISTOGRAM, dtype=int, device="cpu"),
            wp.zeros_like(order),
        ],
        outputs=[order, size],
        device="cpu",
    )
    return order.numpy()[: size.numpy()[0], 1]


RANGES = {
    "an object": (0.8, 1.1),
    "a room": (0.3, 9.0),
    "all floats": (1e-37, 3e38),
    "one depth": (1.0, 1.0),
}


def test_orders_like_a_stable_sort() -> None:
    for name, ends in RANGES.items():
        rng = np.random.default_rng(0)
        nearest, farthest = np.log(ends)
        depths = np.exp(rng.uniform(nearest, farthest, 5000)).astype(np.float32)
        depths[::7] = depths[0]  # equal ones keep the order of their index
        drawn = rng.integers(0, 3, 5000)
        expected = np.flatnonzero(drawn)[np.argsort(depths[drawn > 0], kind="stable")]
        np.testing.assert_array_equal(sort(depths, drawn), expected, err_msg=name)


def test_the_largest_difference_of_bits() -> None:
    depths = np.array([3.4e38, 1e-45, 1.0, 2.0, 1e-45], np.float32)
    np.testing.assert_array_equal(sort(depths, np.ones(5)), [1, 4, 2, 3, 0])
    assert len(sort(np.ones(3), np.zeros(3))) == 0
