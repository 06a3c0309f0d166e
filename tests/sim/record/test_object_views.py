"""Poses, boxes and visible shares of objects, against their corners projected one by one."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull

from digs_warp.data.capture import Capture
from digs_warp.data.objects import Box
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at
from digs_warp.sim.camera.shutter import Shutter, ShutteredEye
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.object_views import ObjectViews
from digs_warp.sim.record.record import simulate
from digs_warp.sim.render.raycast import RaycastRenderer
from digs_warp.sim.scene.arrange import load_objects
from digs_warp.sim.scene.environment import Environment
from reference.mesh_files import save

SIDES = {"a": (0.1, 0.2, 0.15), "b": (0.25, 0.1, 0.08), "c": (0.12, 0.12, 0.3)}
SKY = Environment(np.ones((16, 32, 3), np.float32))


@pytest.fixture(scope="module")
def boxes(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, ...]:
    folder = tmp_path_factory.mktemp("boxes")
    return tuple(
        save(folder / f"{name}.glb", trimesh.creation.box(sides)) for name, sides in SIDES.items()
    )


@pytest.fixture(scope="module")
def config(boxes: tuple[Path, ...]) -> SimulateConfig:
    return SimulateConfig(
        profile="bare-matcher", scene=boxes, frames=6, width=160, samples_per_pixel=1, tier="truth"
    )


@pytest.fixture(scope="module")
def stored(config: SimulateConfig, tmp_path_factory: pytest.TempPathFactory) -> Capture:
    return simulate(config, tmp_path_factory.mktemp("recording") / "capture")


def outline(corners_cam: np.ndarray, k: Intrinsics, grow: int = 0) -> np.ndarray:
    """Pixel centers inside the hull of projected points, on an image that is ``grow`` px larger all round."""
    points = corners_cam[:, :2] / corners_cam[:, 2:] * (k.fx, k.fy) + (k.cx, k.cy) + grow
    edges = ConvexHull(points).equations
    x, y = np.meshgrid(np.arange(k.width + 2 * grow) + 0.5, np.arange(k.height + 2 * grow) + 0.5)
    sides = edges[:, :2] @ np.stack([x.ravel(), y.ravel()]) + edges[:, 2:]
    return np.asarray(sides.max(axis=0) <= 0.0).reshape(x.shape)


def corners_of(name: str) -> np.ndarray:
    return np.array(trimesh.creation.box(SIDES[name]).vertices)


def assert_box(box: Box | None, mask: np.ndarray, shift: int = 0, off: int = 1) -> None:
    """The box is that of a mask, up to ``off`` pixels: float32 rays differ at the outline."""
    rows, columns = np.nonzero(mask)
    assert box is not None
    x, y, width, height = box
    expected = columns.min(), rows.min(), columns.max() + 1, rows.max() + 1
    np.testing.assert_allclose((x, y, x + width, y + height), np.array(expected) - shift, atol=off)


def test_poses_and_shares_agree_with_the_recorded_numbers(stored: Capture) -> None:
    shares = []
    for frame in stored.frames:
        numbers, k = frame.load_instances(), frame.camera.intrinsics
        assert [view.number for view in frame.objects] == [1, 2, 3]
        for view, name in zip(frame.objects, SIDES, strict=True):
            pose = np.array(view.cam_from_object)
            np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-9)
            whole = outline(corners_of(name) @ pose[:3, :3].T + pose[:3, 3], k)
            seen = numbers == view.number
            assert view.pixels_visible == seen.sum()
            # float32 rays differ at few pixels of the outline
            assert abs(view.pixels - int(whole.sum())) <= 3
            assert (seen & ~whole).sum() <= 3
            assert_box(view.box, whole)
            assert (view.box_visible is None) == (not seen.any())
            if seen.any():
                assert_box(view.box_visible, seen, off=0)
            if view.visible_share == 1.0:
                assert (seen & whole).sum() / (seen | whole).sum() > 0.98
            shares.append(view.visible_share)
    assert min(shares) < 0.7 and max(shares) == 1.0  # the scene tests both


@pytest.mark.parametrize("bands", [1, 4])
def test_what_the_image_cuts_off_counts_as_part_of_the_object(
    boxes: tuple[Path, ...], bands: int
) -> None:
    scene = load_objects(boxes[:1], 0)
    k = Intrinsics(60, 50, 80.0, 80.0, 30.0, 25.0)
    pose = look_at(np.array([0.4, 0.0, 0.1]), np.array([0.0, 0.13, 0.0]), np.array([0, 0, 1.0]))
    renderer = RaycastRenderer(scene, SKY)
    eye = ShutteredEye(renderer, Shutter(bands), k, lambda _: pose)
    session = SimpleNamespace(scene=scene, environment=SKY)
    maker: Any = SimpleNamespace(session=session, recorded_eye=lambda _: eye)
    (view,) = ObjectViews.of(maker).in_frame(0)
    mesh_to_world = scene.objects[0].world_from_mesh
    placed = trimesh.transform_points(corners_of("a"), mesh_to_world)
    in_cam = trimesh.transform_points(placed, Camera(k, pose).cam_from_world)
    whole = outline(in_cam, k, grow=100)
    image = whole[100:150, 100:160]
    assert 0.2 < image.sum() / whole.sum() < 0.8  # the border cuts it
    assert abs(view.pixels - int(whole.sum())) <= 3
    assert abs(view.pixels_visible - int(image.sum())) <= 3
    assert_box(view.box, whole, 100)
    assert_box(view.box_visible, image)


def test_an_object_behind_the_camera_has_no_pixels(boxes: tuple[Path, ...]) -> None:
    scene = load_objects(boxes[:1], 0)
    k = Intrinsics(20, 16, 20.0, 20.0, 10.0, 8.0)
    pose = look_at(np.array([1.0, 0, 0]), np.array([2.0, 0, 0]), np.array([0, 0, 1.0]))
    eye = ShutteredEye(RaycastRenderer(scene, SKY), Shutter(), k, lambda _: pose)
    session = SimpleNamespace(scene=scene, environment=SKY)
    maker: Any = SimpleNamespace(session=session, recorded_eye=lambda _: eye)
    (view,) = ObjectViews.of(maker).in_frame(0)
    assert (view.pixels, view.pixels_visible, view.box, view.box_visible) == (0, 0, None, None)
    assert view.visible_share == 0.0
