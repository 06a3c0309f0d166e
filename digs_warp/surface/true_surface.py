"""The mesh that a simulated capture shows, in the capture's world: the ground truth of a reconstruction."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.capture import read_capture
from digs_warp.record.run_log import RunRecord

if TYPE_CHECKING:
    from digs_warp.data.triangle_mesh import TriangleMesh


def read_true_surface(capture: Path) -> "TriangleMesh | None":
    """Return the object of a capture that 'digs-warp simulate' wrote; None for any other recording.

    The mesh file stands where the capture's ``world_from_mesh`` puts it. Its colors are those of its
    materials and textures at the vertices.

    Raises:
        DigsError: the mesh file in the record does not exist any more or cannot be read, or the index does
            not say where it stands.
    """
    from digs_warp.data.triangle_mesh import TriangleMesh
    from digs_warp.sim.vertex_colors import srgb_vertex_colors

    record = RunRecord.find(capture)
    if record is None or record.command != "simulate" or "mesh" not in record.settings:
        return None
    settings = record.settings
    if settings["mesh"] is None:
        from digs_warp.sim.procedural import procedural_scene

        scene = procedural_scene()
    else:
        from digs_warp.sim.load import load_scene_at

        path = Path(settings["mesh"])
        if not path.is_file():
            raise DigsError(f"capture '{capture}': its mesh '{path}' is no longer there")
        placement = read_capture(capture).about.world_from_mesh
        if placement is None:
            raise DigsError(
                f"capture '{capture}': its index has no world_from_mesh, so nobody knows where the mesh "
                f"'{path.name}' stands; record it again"
            )
        scene = load_scene_at(path, np.array(placement))
    return TriangleMesh(scene.vertices, scene.faces, srgb_vertex_colors(scene))
