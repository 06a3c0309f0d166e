"""Objects keep their size, and the capture says where their mesh file stands."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from digs_warp.data.capture import Capture
from digs_warp.data.layers import Layer
from digs_warp.data.triangle_mesh import TriangleMesh
from digs_warp.geometry.camera import pixel_centers
from digs_warp.measure.surface_metrics import distances_to_surface
from digs_warp.show.report.facts import describe
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.record import simulate
from digs_warp.sim.scene.mesh.placement import Unit
from digs_warp.surface.true_surface import read_true_surface
from reference.mesh_files import lopsided, save


def recorded(path: Path, folder: Path, unit: Unit = "auto") -> Capture:
    config = SimulateConfig(
        profile="bare-matcher",
        mesh=path,
        frames=3,
        width=160,
        samples_per_pixel=1,
        tier="law",
        unit=unit,
        ground="none",
    )
    return simulate(config, folder)


def points_on_the_object(capture: Capture, layer: Layer) -> np.ndarray:
    found = []
    for frame in capture.frames:
        k = frame.camera.intrinsics
        depth = frame.load_depth() if layer is Layer.DEPTH else frame.load_depth_true()
        points = frame.camera.unproject(pixel_centers(k.width, k.height), depth)
        # At the border, the one ray that hits the object is not the one whose depth counts.
        assert capture.about.object_radius is not None
        far = np.linalg.norm(frame.camera.center_world) + capture.about.object_radius
        found.append(points[(frame.load_mask() == 255) & (depth < far)])
    return np.concatenate(found)


@pytest.mark.parametrize("suffix", [".obj", ".glb"])
def test_the_file_lies_on_the_surface_that_depth_shows(tmp_path: Path, suffix: str) -> None:
    mesh = lopsided()
    mesh.apply_scale(240 / mesh.extents.max())
    mesh.apply_translation((500.0, -300.0, 40.0))
    path = save(tmp_path / f"a{suffix}", mesh)
    capture = recorded(path, tmp_path / "capture", "mm" if suffix == ".glb" else "auto")
    assert capture.about.world_from_mesh is not None
    world_from_mesh = np.array(capture.about.world_from_mesh)
    placed = trimesh.transform_points(mesh.vertices, world_from_mesh)
    surface = TriangleMesh(placed, mesh.faces, np.ones_like(placed))
    exact = points_on_the_object(capture, Layer.DEPTH_TRUE)
    assert distances_to_surface(exact, surface).max() < 1e-5
    sensed = points_on_the_object(capture, Layer.DEPTH)
    # The noise: 0.1 px of 20 px of disparity at half a metre.
    assert np.median(distances_to_surface(sensed, surface)) < 0.005
    found = read_true_surface(capture.folder)
    assert found is not None
    assert distances_to_surface(placed, found).max() < 1e-5


def test_info_names_size_unit_and_axis_of_a_mesh(tmp_path: Path) -> None:
    facts = describe(save(tmp_path / "a.ply", trimesh.creation.box(extents=(2.0, 1.0, 0.5))))
    assert facts["size"] == "2.000 x 1.000 x 0.500 m in a capture, z up"
    assert facts["up axis"] == "z of the file"
    assert facts["unit"].startswith("PLY has no unit: 2 x 1 x 0.5 taken as m; --mesh-unit")
