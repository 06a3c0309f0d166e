"""The spans of a group of splats are, bit for bit, those that each splat has alone."""

import numpy as np
import pytest
import warp as wp

from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at
from digs_warp.splat.bin_kernels import span_kernel
from digs_warp.splat.config import EXTENT_SLACK
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.renderer import SplatRenderer
from reference.splat_scenes import random_gaussians

POSE = look_at(np.array([0.4, -3.0, 0.5]), np.zeros(3), np.array([0.0, 0.0, 1.0]))
CAMERA = Camera(Intrinsics.from_fov(200, 150, 60.0), POSE)


@pytest.mark.parametrize("count", [1, 1003])
def test_a_group_has_the_spans_of_its_members(count: int) -> None:
    gaussians = random_gaussians(count, seed=1)
    # From less than a pixel to larger than the image, and some that are not drawn between them.
    gaussians.log_scales[:] += np.random.default_rng(2).uniform(-3.0, 2.5, (count, 1))
    gaussians.means[::7, 1] -= 6.0
    renderer = SplatRenderer(DeviceGaussians.from_numpy(gaussians), 200, 150)
    renderer.forward(CAMERA, near=0.01)
    binner, lists = renderer.binner, renderer.binner.lists
    spans, pair_counts = wp.zeros_like(lists.spans), wp.zeros_like(lists.pair_counts)
    given = [lists.splats, lists.first_tile_rows, lists.row_starts, EXTENT_SLACK]
    inputs = [0, renderer._views, *given]
    wp.launch(span_kernel, dim=count, inputs=inputs, outputs=[spans, pair_counts], device="cpu")
    rows = np.diff(lists.row_starts.numpy()[: count + 1])
    assert count < 1000 or (rows.max() >= 5 and (rows == 0).any())
    found = lists.spans.numpy()[: binner.total_rows]
    np.testing.assert_array_equal(found, spans.numpy()[: binner.total_rows])
    np.testing.assert_array_equal(lists.pair_counts.numpy(), pair_counts.numpy())
