"""The mesh that a simulated capture shows, in the capture's world: the ground truth of a reconstruction."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.capture import read_capture
from digs_warp.data.objects import Matrix
from digs_warp.record.layout import places_of
from digs_warp.record.run_log import RunRecord

if TYPE_CHECKING:
    from digs_warp.data.triangle_mesh import TriangleMesh
    from digs_warp.sim.scene.scene import Scene


def read_true_surface(
    capture: Path, instance: int | None = None, textured: bool = True
) -> "TriangleMesh | None":
    """Return the objects of a capture as one mesh, or one of them; see `read_true_surfaces`.

    Args:
        capture: folder of the recording.
        instance: number of an object, from 1; None: all of them.
        textured: whether the colors matter; without them, the built-in object is there ten times as fast.
    """
    scenes = _true_scenes(capture, textured)
    if scenes is None:
        return None
    if instance is not None:
        if not 1 <= instance <= len(scenes):
            raise DigsError(f"capture '{capture}': no object {instance}, only {len(scenes)}")
        return _surface(scenes[instance - 1])
    from digs_warp.sim.scene.join import join_scenes

    return _surface(join_scenes(*scenes) if len(scenes) > 1 else scenes[0])


def read_true_surfaces(capture: Path) -> "list[TriangleMesh] | None":
    """Return each object of a capture that 'digs-warp simulate' wrote; None for any other recording.

    The mesh files stand where the capture's ``world_from_mesh`` puts them. Their colors are those of their
    materials and textures at the vertices.

    Raises:
        DigsError: a mesh file in the record does not exist any more or cannot be read, or the index does not
            say where it stands.
    """
    scenes = _true_scenes(capture)
    return None if scenes is None else [_surface(scene) for scene in scenes]


def _surface(scene: "Scene") -> "TriangleMesh":
    from digs_warp.data.triangle_mesh import TriangleMesh
    from digs_warp.sim.scene.join import srgb_vertex_colors

    return TriangleMesh(scene.vertices, scene.faces, srgb_vertex_colors(scene))


def _true_scenes(capture: Path, textured: bool = True) -> "list[Scene] | None":
    record = RunRecord.find(capture)
    if record is None or record.command != "simulate" or "mesh" not in record.settings:
        return None
    settings = record.settings
    if settings.get("scene"):
        return _placed_objects(capture)
    if settings["mesh"] is None:
        from digs_warp.sim.scene.builtin import builtin_scene, builtin_shape

        return [builtin_scene() if textured else builtin_shape()]
    about = read_capture(capture).about
    return [_mesh_at(capture, Path(settings["mesh"]), about.world_from_mesh)]


def _placed_objects(capture: Path) -> "list[Scene]":
    objects = read_capture(capture).about.objects or ()
    meshes = [(each.mesh, each.world_from_mesh) for each in objects if each.mesh is not None]
    if not meshes:
        raise DigsError(f"capture '{capture}': its index names no objects; record it again")
    return [_mesh_at(capture, Path(mesh), matrix) for mesh, matrix in meshes]


def _mesh_at(capture: Path, path: Path, placement: Matrix | None) -> "Scene":
    from digs_warp.sim.scene.load import load_scene_at

    place = next((place for place in places_of(path, capture) if place.is_file()), None)
    if place is None:
        raise DigsError(f"capture '{capture}': its mesh '{path}' is no longer there")
    if placement is None:
        raise DigsError(
            f"capture '{capture}': its index has no world_from_mesh, so nobody knows where the mesh "
            f"'{path.name}' stands; record it again"
        )
    return load_scene_at(place, np.array(placement))
