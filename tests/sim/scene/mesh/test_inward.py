"""A room modeled from inside is named: the camera would walk around it and see its walls from behind."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from digs_warp.sim.scene.load import load_scene
from reference.mesh_files import save


def room(*missing: tuple[int, int, int], normals: bool = False) -> trimesh.Trimesh:
    """Walls that look inward, but for those that look in the directions ``missing``, and a table."""
    walls = trimesh.creation.box((5.0, 4.0, 2.6))
    walls.invert()
    for direction in missing:
        walls.update_faces(walls.face_normals @ direction < 0.9)
    table = trimesh.creation.box((1.4, 0.8, 0.7))
    table.apply_translation((0.5, 0.0, -0.95))
    whole: Any = trimesh.util.concatenate([walls, table])
    whole.unmerge_vertices()
    if normals:
        whole.vertex_normals  # noqa: B018  (saved then)
    return whole


@pytest.mark.parametrize("missing", [(), ((0, 0, -1),)], ids=["closed", "no ceiling"])
@pytest.mark.parametrize("normals", [False, True])
def test_a_room_from_inside_is_named(
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
    missing: tuple[tuple[int, int, int], ...],
    normals: bool,
) -> None:
    load_scene(save(tmp_path / "room.ply", room(*missing, normals=normals)), unit="m")
    (record,) = caplog.records
    assert "its outer faces look inward" in record.getMessage()


def test_a_room_that_is_cut_open_is_not(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    cut = room((0, 0, -1), (1, 0, 0), (0, 1, 0))
    load_scene(save(tmp_path / "corner.ply", cut), unit="m", up="z")
    assert not caplog.records


def test_what_has_normals_is_judged_by_them(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """A box whose windings are wrong, but whose normals are right, is drawn right."""
    box = trimesh.creation.box((0.2, 0.3, 0.1))
    box.unmerge_vertices()
    normals = np.repeat(box.face_normals, 3, axis=0)
    wrong = trimesh.Trimesh(box.vertices, box.faces[:, ::-1], vertex_normals=normals, process=False)
    load_scene(save(tmp_path / "box.glb", wrong), up="y")
    assert not caplog.records
