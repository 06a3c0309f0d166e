"""`digs-warp bench mesh`: how near the mesh of the built-in object comes to the true one, by voxel size."""

import time

from digs_warp.film.camera_path import find_subject
from digs_warp.measure.surface_metrics import surface_score
from digs_warp.record.progress import progress
from digs_warp.study.results import Result
from digs_warp.study.trained_object import TrainedObject, trained_object
from digs_warp.surface.extract import Scene, extract_surface

VOXELS = (0.008, 0.004, 0.003, 0.002)  # [m]; the object is half a metre high
NEAR = 0.005  # [m], what counts as near for the F-score


def bench_mesh() -> list[Result]:
    """Return what a trained reconstruction of the built-in object gives, see `measure_meshes`."""
    return measure_meshes(trained_object())


def measure_meshes(
    trained: TrainedObject, voxels: tuple[float, ...] = VOXELS, near: float = NEAR
) -> list[Result]:
    """Return seconds, triangles and distances [mm] to the true surface, by voxel size [m].

    The way from the truth to the mesh counts what no camera saw, such as the inside of the vessel.
    """
    subject = find_subject(trained.gaussians)
    scene = Scene(subject.center_world, subject.radius)
    results: list[Result] = []
    with progress(len(voxels), "Measuring", "mesh") as bar:
        for voxel in voxels:
            start = time.perf_counter()
            mesh = extract_surface(trained.gaussians, trained.cameras, scene, voxel).mesh
            seconds = time.perf_counter() - start
            score = surface_score(mesh.points_world, trained.surface, near)
            settings = {
                "voxel_mm": round(1e3 * voxel, 3),
                "views": len(trained.cameras),
                "splats": len(trained.gaussians),
            }
            figures = (
                ("time", seconds, "s"),
                ("triangles", float(len(mesh)), ""),
                ("mesh to truth", 1e3 * score.accuracy, "mm"),
                ("truth to mesh", 1e3 * score.completeness, "mm"),
                ("Chamfer", 1e3 * score.chamfer, "mm"),
                (f"F-score at {1e3 * near:g} mm", score.f_score, ""),
            )
            results += [Result(name, value, unit, settings) for name, value, unit in figures]
            bar.update()
    return results
