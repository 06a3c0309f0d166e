"""The benchmark of meshes on a ball: smaller voxels come nearer to the truth."""

import numpy as np
import trimesh

from digs_warp.camera import Intrinsics
from digs_warp.data.triangle_mesh import TriangleMesh
from digs_warp.film.camera_path import Subject, orbit
from digs_warp.study.bench_mesh import bench_mesh, measure_meshes
from digs_warp.study.benchmarks import BENCHMARKS
from digs_warp.study.trained_object import TrainedObject
from reference.optional import open3d_or_skip
from reference.tiny_capture import RADIUS, ball


def test_distances_by_voxel_size() -> None:
    open3d_or_skip()
    g = ball(4000)
    g.log_scales[:] = np.log(0.005)
    k = Intrinsics.from_fov(96, 96, 40.0)
    cameras = [c for e in (-60, 0, 60) for c in orbit(Subject(np.zeros(3), RADIUS), k, 8, e)]
    sphere = trimesh.creation.icosphere(subdivisions=4, radius=RADIUS)
    surface = TriangleMesh(sphere.vertices, sphere.faces, np.ones_like(sphere.vertices))
    results = measure_meshes(TrainedObject(g, cameras, surface), voxels=(0.03, 0.01), near=0.01)
    values = {(r.settings["voxel_mm"], r.name): r.value for r in results}
    assert values[10.0, "triangles"] > 4 * values[30.0, "triangles"]
    assert values[10.0, "Chamfer"] < 10.0  # a voxel
    assert values[10.0, "F-score at 10 mm"] > 0.9


def test_it_is_on_the_list() -> None:
    benchmark = next(b for b in BENCHMARKS if b.name == "mesh")
    assert benchmark.function == f"{bench_mesh.__module__}:{bench_mesh.__name__}"
