"""Several objects: beside each other, apart, on the ground; their poses, boxes and visible shares."""

from dataclasses import replace
from itertools import combinations
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull, KDTree

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.objects import Box, ObjectView
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at
from digs_warp.sim.camera.shutter import Shutter, ShutteredEye
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.inputs import load_inputs
from digs_warp.sim.record.object_views import ObjectViews
from digs_warp.sim.record.record import simulate
from digs_warp.sim.record.session import prepare_session
from digs_warp.sim.render.raycast import RaycastRenderer
from digs_warp.sim.scene.arrange import arrange, load_objects, plan_of
from digs_warp.sim.scene.environment import TABLE_HEIGHT, Environment, Ground
from digs_warp.sim.scene.join import join_scenes
from digs_warp.sim.scene.scene import FURNITURE, Material, Scene
from reference.mesh_files import save
from reference.plates import plate
from reference.raycast_scenes import see

MM = 1e-3
SIDES = {"a": (0.1, 0.2, 0.15), "b": (0.25, 0.1, 0.08), "c": (0.12, 0.12, 0.3)}


@pytest.fixture(scope="module")
def boxes(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, ...]:
    folder = tmp_path_factory.mktemp("boxes")
    return tuple(
        save(folder / f"{name}.glb", trimesh.creation.box(sides)) for name, sides in SIDES.items()
    )


def separation(a: np.ndarray, b: np.ndarray) -> float:
    """The largest distance between two convex polygons along the normal of an edge; below 0: they overlap."""
    best = -np.inf
    for one, other in ((a, b), (b, a)):
        edges = np.roll(one, -1, axis=0) - one
        edges = edges[np.linalg.norm(edges, axis=1) > 1e-9]
        for normal in np.stack([edges[:, 1], -edges[:, 0]], axis=1):
            normal = normal / np.linalg.norm(normal)
            best = max(best, (other @ normal).min() - (one @ normal).max())
    return float(best)


@pytest.mark.parametrize("seed", range(3))
def test_plans_are_apart_but_close(seed: int) -> None:
    rng = np.random.default_rng(seed)
    plans = [
        plan_of(rng.normal(size=(12, 3)) * rng.uniform(0.02, 0.3, 3))
        for _ in range(rng.integers(2, 9))
    ]
    spots = arrange(plans, np.random.default_rng(seed))
    placed = [plan @ spot[:2, :2].T + spot[:2, 3] for plan, spot in zip(plans, spots, strict=True)]
    least = 0.03 * np.median([np.ptp(plan, axis=0).max() for plan in plans])
    gaps = np.array([separation(a, b) for a, b in combinations(placed, 2)])
    assert gaps.min() >= least * (1 - 1e-9)
    # The circle around all of them is at most twice that of all their areas.
    points = np.concatenate(placed)
    widest = np.linalg.norm(points - points.mean(axis=0), axis=1).max()
    alone = max(np.linalg.norm(plan, axis=1).max() for plan in plans)
    area = sum(np.pi * np.linalg.norm(plan, axis=1).max() ** 2 for plan in plans)
    assert widest < 2 * np.sqrt(area / np.pi) + alone
    np.testing.assert_array_equal(arrange(plans, np.random.default_rng(seed)), spots)


def test_objects_stand_on_one_ground_around_the_origin(boxes: tuple[Path, ...]) -> None:
    scene, other = (load_objects([*boxes, boxes[0]], seed) for seed in (3, 4))
    assert np.abs(scene.vertices - other.vertices).max() > 0.01
    assert [each.name for each in scene.objects] == ["a", "b", "c", "a"]
    np.testing.assert_allclose(
        scene.vertices.min(axis=0) + scene.vertices.max(axis=0), 0, atol=1e-7
    )
    ground = scene.vertices[:, 2].min()
    for number, each in enumerate(scene.objects, start=1):
        points = scene.vertices[np.unique(scene.faces[scene.face_objects == number])]
        assert points[:, 2].min() == pytest.approx(ground, abs=1e-7)
        np.testing.assert_allclose(np.ptp(points, axis=0), each.size, atol=1e-7)
        sides = SIDES[each.name]
        assert each.size[2] == pytest.approx(sides[1])  # y up, as in glTF
        assert each.mesh is not None
        mesh = trimesh.load(each.mesh, force="mesh")
        assert isinstance(mesh, trimesh.Trimesh)
        there = trimesh.transform_points(mesh.vertices, each.world_from_mesh)
        assert KDTree(points).query(there)[0].max() < 1e-6
        assert np.linalg.det(each.world_from_mesh[:3, :3]) == pytest.approx(1.0)


@pytest.mark.parametrize("ground", ["floor", "table"])
def test_what_is_recorded_touches_its_ground_and_nothing_else(
    boxes: tuple[Path, ...], ground: Ground
) -> None:
    config = SimulateConfig(
        profile="bare-matcher",
        scene=boxes,
        ground=ground,
        object_turn=35.0,
        frames=1,
        width=32,
    )
    session = prepare_session(config, load_inputs(config))
    scene, floor = session.scene, session.environment.floor
    assert floor is not None
    top = floor if ground == "floor" else floor + TABLE_HEIGHT
    if ground == "table":  # its top is at that height, and under all of them
        wood = scene.vertices[np.unique(scene.faces[scene.face_objects == FURNITURE])]
        level = wood[np.abs(wood[:, 2] - top) < MM / 10, :2]
        for edge, inside in ((level.min(axis=0), -1), (level.max(axis=0), 1)):
            assert (inside * (edge - scene.object_vertices[:, :2]) > 0).all()
    plans = []
    for number in range(1, len(boxes) + 1):
        points = scene.vertices[np.unique(scene.faces[scene.face_objects == number])]
        assert abs(points[:, 2].min() - top) < MM  # neither gap nor penetration
        plans.append(plan_of(points))
    assert min(separation(*pair) for pair in combinations(plans, 2)) > 0


def test_a_given_size_scales_all_objects_by_one_factor(boxes: tuple[Path, ...]) -> None:
    scene = load_objects(boxes, 0, size=0.6)
    scales = [np.cbrt(np.linalg.det(each.world_from_mesh[:3, :3])) for each in scene.objects]
    np.testing.assert_allclose(scales, 2.0)
    assert load_objects(boxes, 0, up="z").objects[0].size[2] == pytest.approx(0.15)


def test_contradictions_are_named(tmp_path: Path) -> None:
    house = save(tmp_path / "house.glb", trimesh.creation.box((9.0, 9.0, 9.0)))
    with pytest.raises(DigsError, match="--mesh and --scene contradict each other"):
        SimulateConfig(mesh=house, scene=(house,))
    with pytest.raises(DigsError, match="256 files, expected at most 255"):
        load_objects([house] * 256, 0)


SKY = Environment(np.ones((16, 32, 3), np.float32))


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


def view_of(scene: Scene, shutter: Shutter, k: Intrinsics, pose: np.ndarray) -> ObjectView:
    """The only object of a scene, as a camera at rest sees it."""
    eye = ShutteredEye(RaycastRenderer(scene, SKY), shutter, k, lambda _: pose)
    session = SimpleNamespace(scene=scene, environment=SKY)
    maker: Any = SimpleNamespace(session=session, recorded_eye=lambda _: eye)
    (view,) = ObjectViews.of(maker).in_frame(0)
    return view


@pytest.mark.parametrize("bands", [1, 4])
def test_what_the_image_cuts_off_counts_as_part_of_the_object(
    boxes: tuple[Path, ...], bands: int
) -> None:
    scene = load_objects(boxes[:1], 0)
    k = Intrinsics(60, 50, 80.0, 80.0, 30.0, 25.0)
    pose = look_at(np.array([0.4, 0.0, 0.1]), np.array([0.0, 0.13, 0.0]), np.array([0, 0, 1.0]))
    view = view_of(scene, Shutter(bands), k, pose)
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
    view = view_of(scene, Shutter(), k, pose)
    assert (view.pixels, view.pixels_visible, view.box, view.box_visible) == (0, 0, None, None)
    assert view.visible_share == 0.0


GREY = Material("gray", np.full(3, 0.5, np.float32))
# Looks along -x at the plane x = 0 from 1 m: 100 px per metre, the origin in the middle.
CAMERA = Camera(
    Intrinsics(80, 60, 100.0, 100.0, 40.0, 30.0),
    look_at(np.array([1.0, 0, 0]), np.zeros(3), np.array([0, 0, 1.0])),
)


def upright(x: float, y: float, half: float, material: Material = GREY) -> Scene:
    """A square that faces the camera, ``half`` a side, at height 0."""
    return plate((x, y, 0), (0, half, 0), (0, 0, half), material)


def furniture(scene: Scene) -> Scene:
    """The same triangles, as no object."""
    return replace(scene, face_objects=np.zeros(len(scene.faces), np.int32), objects=())


# Two squares of 20 px, 10 px left and right of the middle, before furniture of twice the height.
SCENE = join_scenes(
    upright(0.0, -0.2, 0.1), furniture(upright(-1e-3, 0.0, 0.2003)), upright(0.0, 0.2, 0.1)
)


def test_masks_and_numbers_tell_objects_from_furniture() -> None:
    view = see(RaycastRenderer(SCENE, SKY), CAMERA, 4)
    numbers = np.zeros((60, 80), np.int32)
    numbers[20:40, 10:30], numbers[20:40, 50:70] = 1, 2
    np.testing.assert_array_equal(view.object_ids, numbers)
    np.testing.assert_array_equal(view.mask, np.where(numbers > 0, 255, 0))
    assert (view.material_ids >= 0).sum() == 40 * 40 + 2 * 20 * 10  # furniture is there, too
    np.testing.assert_array_equal(view.depth[view.material_ids < 0] > 2, True)


def test_furniture_before_an_object_hides_it_unless_it_is_glass() -> None:
    behind = upright(0.0, 0.0, 0.1)
    glass = Material("glass", np.ones(3, np.float32), transmission=1.0, roughness=0.0)
    for material, seen in ((GREY, 0), (glass, 255)):
        front = furniture(upright(0.01, 0.0, 0.15, material))
        view = see(RaycastRenderer(join_scenes(behind, front), SKY), CAMERA, 4)
        assert (view.mask[21:39, 31:49] == seen).all()
        assert (view.mask == 255).sum() == (400 if seen else 0)
        assert not view.object_ids.any()  # depth, too, is that of the glass
