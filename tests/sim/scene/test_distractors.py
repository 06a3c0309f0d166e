"""Distractors stand beside the objects: on the same ground, apart from each other, in no mask."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.sim.record.record import simulate_in_memory
from digs_warp.sim.scene.builtin import builtin_scene
from digs_warp.sim.scene.distractors import GAP, REACH, add_distractors
from digs_warp.sim.scene.scene import FURNITURE, Scene
from digs_warp.sim.scene.shapes import plain_shape
from reference.mesh_files import TETRAHEDRON, under_gray_sky

OBJECT = builtin_scene()
PLATE_CORNERS = np.array([(0, 0, 0), (2, 0, 0), (2, 1, 0), (0, 1, 0), (1, 0.5, 0.2)])
PLATE_FACES = "f 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\nf 4 3 2\nf 4 2 1\n"


def things_of(scene: Scene) -> list[np.ndarray]:
    """Vertices of each distractor: they have materials of their own."""
    beside = np.unique(scene.face_materials[scene.face_objects == FURNITURE])
    return [scene.vertices[np.unique(scene.faces[scene.face_materials == m])] for m in beside]


def test_they_stand_on_the_ground_of_the_object_and_are_none() -> None:
    scene = add_distractors(OBJECT, 7, (), seed=9, distance=2.0)  # one is close to the object
    things = things_of(scene)
    assert len(things) == 7
    floor = OBJECT.vertices[:, 2].min()
    radius = OBJECT.object_radius
    inner = np.linalg.norm(OBJECT.vertices[:, :2], axis=1).max()
    for thing in things:
        assert thing[:, 2].min() == pytest.approx(floor, abs=1e-6)
        away = np.linalg.norm(thing[:, :2], axis=1)
        assert away.min() > inner + GAP * radius - 1e-6 and away.max() <= REACH * radius + 1e-6
    gaps = [
        np.linalg.norm(a[:, None, :2] - b[None, :, :2], axis=2).min()
        for i, a in enumerate(things)
        for b in things[:i]
    ]
    assert min(gaps) > GAP * radius - 1e-6
    used = OBJECT.vertices[np.unique(OBJECT.faces)]
    np.testing.assert_array_equal(scene.object_vertices, used)
    assert scene.object_radius == OBJECT.object_radius


def test_the_camera_does_not_run_into_them() -> None:
    scene = add_distractors(OBJECT, 5, (), seed=1, distance=0.45)
    away = max(np.linalg.norm(thing[:, :2], axis=1).max() for thing in things_of(scene))
    assert away <= 0.75 * 0.45 + 1e-6


def test_meshes_keep_their_size_where_there_is_room(tmp_path: Path) -> None:
    path = tmp_path / "plate.obj"  # y is up: its plan is that of x and z
    for length, scaled in ((0.1, False), (3.0, True)):
        scale = length / 2
        corners = [f"v {x} {y} {z}\n" for x, y, z in scale * PLATE_CORNERS]
        path.write_text("".join(corners) + PLATE_FACES)
        scene = add_distractors(OBJECT, 0, [path], seed=0, distance=2.0)
        (thing,) = things_of(scene)
        plan = np.linalg.norm(
            thing[:, :2] - (thing[:, :2].min(0) + thing[:, :2].max(0)) / 2, axis=1
        )
        if scaled:
            assert plan.max() < 0.4 * OBJECT.object_radius + 1e-6
        else:
            assert plan.max() == pytest.approx(np.hypot(1, 0.5) * scale, rel=1e-4)


def test_shapes_are_closed_and_their_normals_point_outward() -> None:
    import trimesh

    for seed in range(12):
        shape = plain_shape(np.random.default_rng(seed), 0.1)
        mesh = trimesh.Trimesh(shape.vertices, shape.faces, process=False)
        mesh.merge_vertices(merge_norm=True, merge_tex=True, digits_vertex=6)
        assert mesh.is_watertight and mesh.volume > 0
        assert np.linalg.norm(shape.vertices[:, :2], axis=1).max() == pytest.approx(0.1, rel=1e-3)
        assert shape.vertices[:, 2].min() == pytest.approx(0, abs=1e-7)
        a, b, c = np.moveaxis(shape.vertices[shape.faces].astype(np.float64), 1, 0)
        outward = np.cross(b - a, c - a)
        assert (np.einsum("fi,fi->f", outward, shape.normals[shape.faces[:, 0]]) > 0).all()


def test_they_are_seen_but_in_no_mask(tmp_path: Path) -> None:
    alone = under_gray_sky(tmp_path, TETRAHEDRON, width=96, tier="truth")
    before, after = (
        simulate_in_memory(replace(alone, distractors=count)).frames[0] for count in (0, 6)
    )
    nearer = after.load_depth_true() < before.load_depth_true() - 1e-4
    assert nearer.mean() > 0.02
    assert (after.load_depth_true() <= before.load_depth_true() + 1e-4).all()
    # One sample at the middle of each pixel: the mask is 0 or 255, up to its place in the pixel.
    mask_before, mask_after = before.load_mask() == 255, after.load_mask() == 255
    assert not (mask_after & nearer & ~mask_before).any()
    assert mask_after[~nearer].sum() > 0.95 * mask_before[~nearer].sum() > 0
