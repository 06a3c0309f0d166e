"""Where things stand on a page, and what a page cuts off and saves."""

from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.gaussians import joined
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at
from digs_warp.pipeline.scene_files import read_scene
from digs_warp.show.view.placement import RADIUS, Box, Placement, save_cropped, side_by_side
from digs_warp.show.view.streamer import TrueRenderer
from reference.tiny_capture import ball

INTRINSICS = Intrinsics.from_fov(64, 48, 50)
UP = np.array([0.0, 0.0, 1.0])


def test_most_of_a_scene_lies_within_the_radius_wherever_it_was() -> None:
    rng = np.random.default_rng(0)
    points = rng.normal(size=(1000, 3)) * 1e-3 + [5.0, -2.0, 1.0]
    points[:5] += 10.0  # strays
    page = Placement.of(points).points(points)
    distances = np.linalg.norm(page, axis=1)
    assert np.median(distances) > 0.3 * RADIUS
    assert 0.95 < (distances <= RADIUS).mean() < 1.0


def test_a_thin_handle_lies_within_the_radius_and_a_stray_does_not() -> None:
    rng = np.random.default_rng(0)
    body = rng.uniform(-1.0, 1.0, (10_000, 3)) * [0.5, 0.5, 1.0]
    handle = np.stack([np.zeros(50), np.zeros(50), np.linspace(1.0, 1.6, 50)], axis=1)
    strays = rng.normal(size=(20, 3)) + [0.0, 9.0, 0.0]
    placement = Placement.of(np.concatenate([body, handle, strays]))
    assert np.linalg.norm(placement.points(handle), axis=1).max() < 1.02 * RADIUS
    assert np.linalg.norm(placement.points(body), axis=1).max() > 0.8 * RADIUS


def test_a_single_point_has_a_place() -> None:
    placement = Placement.of(np.array([[1.0, 2.0, 3.0]]))
    assert np.allclose(placement.points(np.array([[1.0, 2.0, 3.0]])), 0.0)


@pytest.mark.parametrize("shown", ["color", "depth", "normals"])
def test_gaussians_look_the_same_on_the_page_as_in_the_world(shown) -> None:
    gaussians = ball()
    placement = Placement.of(gaussians.means, (3.0, 0.0, 0.0))
    eye, target = np.array([0.0, -1.0, 0.4]), gaussians.means.mean(axis=0)
    world = Camera(INTRINSICS, look_at(eye, target, UP))
    moved = placement.points(np.array([eye, target])).astype(np.float64)
    page = Camera(INTRINSICS, look_at(moved[0], moved[1], UP))
    one = TrueRenderer(gaussians).draw(world, shown)
    other = TrueRenderer(placement.gaussians(gaussians)).draw(page, shown)
    assert (one.image != 255).any()
    assert np.abs(one.image.astype(int) - other.image).mean() < 0.1
    seen = np.isfinite(one.depth)
    assert 0.05 < seen.mean() < 0.9
    assert (seen == np.isfinite(other.depth)).mean() > 0.999
    both = seen & np.isfinite(other.depth)
    assert np.allclose(placement.scale * one.depth[both], other.depth[both], rtol=1e-3)


def test_joined_gaussians_keep_their_colors() -> None:
    rich, plain = ball(), ball()
    rich = joined([rich])
    plain = type(plain)(
        plain.means + 1, plain.log_scales, plain.quats, plain.opacity_logits, plain.sh[:, :1]
    )
    both = joined([plain, rich])
    assert len(both) == len(plain) + len(rich)
    assert both.sh.shape[1] == rich.sh.shape[1]
    assert np.array_equal(both.sh[: len(plain), :1], plain.sh)
    assert not both.sh[: len(plain), 1:].any()
    assert np.array_equal(both.sh[len(plain) :], rich.sh)


def test_several_stand_in_a_row_around_the_origin() -> None:
    assert side_by_side(1) == [(0.0, 0.0, 0.0)]
    offsets = np.array(side_by_side(3))
    assert np.allclose(offsets.mean(axis=0), 0)
    assert (np.diff(offsets[:, 0]) > 2 * RADIUS).all()


def test_what_lies_in_the_box_is_saved_in_the_world(tmp_path: Path) -> None:
    gaussians = ball()
    placement = Placement.of(gaussians.means)
    keep = Box((RADIUS, 0.0, 0.0), (2 * RADIUS,) * 3).holds(placement.points(gaussians.means))  # type: ignore[arg-type]
    assert 0.3 < keep.mean() < 0.7
    said = save_cropped(tmp_path / "half.ply", gaussians, keep, "ball")
    assert f"{keep.sum():,} of {len(gaussians):,}" in said
    saved = read_scene(tmp_path / "half.ply").gaussians
    assert np.allclose(saved.means, gaussians.means[keep], atol=1e-6)
    with pytest.raises(DigsError, match="exists"):
        save_cropped(tmp_path / "half.ply", gaussians, keep, "ball")
    with pytest.raises(DigsError, match="no Gaussian lies in the box"):
        save_cropped(tmp_path / "none.ply", gaussians, keep & False, "ball")
    with pytest.raises(DigsError, match="suffix"):
        save_cropped(tmp_path / "half.txt", gaussians, keep, "ball")
