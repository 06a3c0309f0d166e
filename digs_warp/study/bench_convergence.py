"""`digs-warp bench convergence`: how fast held-out views get better, against the settings of 3DGS.

The built-in object is recorded (not timed) and initialized from its depth; the same points are then trained
twice, with the defaults for a dense start and with the start and the rates of the 3DGS reference.
"""

import tempfile
from dataclasses import replace
from pathlib import Path

from digs_warp.data.point_cloud import PointCloud
from digs_warp.device.parallel import default_threads
from digs_warp.init.config import InitConfig
from digs_warp.init.seed_gaussians import INITIAL_OPACITY, seed_gaussians
from digs_warp.record.progress import progress
from digs_warp.study.results import Result
from digs_warp.study.training_case import Case, SceneSize, record_scene, train_case
from digs_warp.train.config import REFERENCE_RATES, TrainConfig

SIZE = SceneSize(960, 540, frames=32, voxel_size=0.003)
ITERATIONS = 300
MEASURE_AT = (0, 10, 25, 50, 100, 150, 200, 300)

DENSE, REFERENCE = "dense start", "3DGS"


def bench_convergence(size: SceneSize = SIZE, iterations: int = ITERATIONS) -> list[Result]:
    """Return PSNR [dB] of the held-out views along iterations and seconds, for both settings."""
    results: list[Result] = []
    with tempfile.TemporaryDirectory() as folder:
        scene = record_scene(size, Path(folder) / "capture")
        cases = _cases(scene.points, iterations)
        with progress(len(cases), "Training both settings", "run") as bar:
            for case in cases:
                shared = {
                    "image": f"{size.width}x{size.height}",
                    "splats": len(case.seeds),
                    "threads": default_threads(),
                    "settings": case.name,
                }
                for m in train_case(case, scene, MEASURE_AT):
                    at = {"iteration": m.iteration, "seconds": round(m.seconds, 2)}
                    results.append(Result("held-out PSNR", m.psnr, "dB", shared | at))
                bar.update()
    return results


def _cases(points: PointCloud, iterations: int) -> list[Case]:
    init = InitConfig()
    dense = TrainConfig(iterations=iterations)
    r = REFERENCE_RATES
    reference = replace(
        dense,
        means_rate=r.means,
        scales_rate=r.scales,
        quats_rate=r.quats,
        opacities_rate=r.opacities,
        colors_rate=r.colors,
        half_size_until=0.0,
    )
    degree = dense.sh_degree
    return [
        Case(DENSE, seed_gaussians(points, degree, init.seed_opacity, init.seed_width), dense),
        Case(REFERENCE, seed_gaussians(points, degree, INITIAL_OPACITY), reference),
    ]
