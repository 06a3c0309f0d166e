"""Measured depth in meshes: taken where the photographs confirm it, not where whole regions are wrong."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.pipeline.mesh import MeasuredDepth, extract_mesh, measured_depth
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.surface.depth_views import MOST_SHARE
from reference.optional import open3d_or_skip
from reference.tiny_capture import ball, drawn_depth, write_tiny_capture

GAUSSIANS = ball()
RANDOM = np.random.default_rng(0)


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory) -> list[Frame]:
    """Photographs of the ball, with the depth of its skin."""
    capture = write_tiny_capture(tmp_path_factory.mktemp("tiny") / "capture", frames=12)
    return [frame.with_layer(Layer.DEPTH, drawn_depth(frame)) for frame in capture.frames]


def measured(
    frames: Sequence[Frame], wrong: Callable[[np.ndarray], np.ndarray]
) -> MeasuredDepth | None:
    """Return the depth of the frames with errors, as a mesh would take it."""
    sensed = [f.with_layer(Layer.DEPTH, wrong(f.load_depth()).astype(np.float32)) for f in frames]
    return measured_depth(GAUSSIANS, sensed, np.zeros(3), is_object=True)


def test_wrong_regions_are_not(frames: Sequence[Frame]) -> None:
    def blotched(depth: np.ndarray) -> np.ndarray:
        rows, columns = np.indices(depth.shape) // 8
        return depth + 0.01 * np.sin(2.0 * rows + 3.0 * columns)

    assert measured(frames, blotched) is None
    some = [frames[0].without_layer(Layer.DEPTH), *frames[1:]]
    assert measured_depth(GAUSSIANS, some, np.zeros(3), is_object=True) is None


def test_a_shift_of_all_disparities_is_taken_off(frames: Sequence[Frame]) -> None:
    found = measured(frames, lambda depth: depth / (1.0 + 0.01 * depth))
    assert found is not None
    for frame, load in zip(frames, found.load, strict=True):
        apart = load() - frame.load_depth()
        assert abs(np.nanmedian(apart)) < 0.001  # of 8 mm


def test_a_mesh_is_drawn_to_depth_that_is_trusted(frames: Sequence[Frame]) -> None:
    open3d_or_skip()
    nearer = [f.with_layer(Layer.DEPTH, f.load_depth() - np.float32(0.0004)) for f in frames]
    alone = [frame.without_layer(Layer.DEPTH) for frame in frames]

    def radius(seen: Sequence[Frame]) -> tuple[float, float]:
        found = extract_mesh(
            result.gaussians, replace(result.poses, frames=PosedFrames(tuple(seen), ())), 0.005
        )
        return float(np.linalg.norm(found.mesh.points_world, axis=1).mean()), found.trust

    result = Reconstruction(gaussians=GAUSSIANS)
    drawn, trust = radius(nearer)
    rendered, none = radius(alone)
    assert trust > 0.9 and none == 0.0
    # Along the rays, which meet most of the ball at a slant.
    assert 0.3 < (drawn - rendered) / (MOST_SHARE * 0.0004) < 1.0
