"""`digs-warp bench paper-length`: runs as long as the paper's at its image size, on a real object.

The mustard bottle of the sample data, else the built-in object, is recorded at 1600x900 with the depth law
of a stereo camera (not timed) and initialized as Highdepth from exact poses; 100, 1000 and 12,000 steps are
three runs, because the learning rates fall along a whole run.
"""

import tempfile
from collections.abc import Sequence
from pathlib import Path

from digs_warp.device.parallel import default_threads
from digs_warp.init.config import InitConfig
from digs_warp.init.seed_gaussians import seed_gaussians
from digs_warp.record.progress import progress
from digs_warp.study.results import Result
from digs_warp.study.sample_data import sample_data
from digs_warp.study.training_case import Case, SceneSize, record_scene, train_case
from digs_warp.train.config import TrainConfig

SIZE = SceneSize(1600, 900, frames=40, voxel_size=0.003)
ITERATIONS = (100, 1000, 12_000)
MESH = Path("meshes/ycb_mustard_bottle/ycb_mustard_bottle.glb")


def bench_paper_length(
    size: SceneSize = SIZE, iterations: Sequence[int] = ITERATIONS
) -> list[Result]:
    """Return training seconds and the PSNR [dB] of the held-out views for each length of a run."""
    mesh = sample_data() / MESH
    mesh = mesh if mesh.is_file() else None
    results: list[Result] = []
    with tempfile.TemporaryDirectory() as folder:
        scene = record_scene(size, Path(folder) / "capture", mesh)
        init = InitConfig()
        with progress(sum(iterations), "Training", "step") as bar:
            for count in iterations:
                config = TrainConfig(iterations=count)
                seeds = seed_gaussians(
                    scene.points, config.sh_degree, init.seed_opacity, init.seed_width
                )
                (end,) = train_case(Case(str(count), seeds, config), scene, after_step=bar.update)
                settings = {
                    "iterations": f"{count:,}",
                    "object": mesh.stem if mesh else "built-in vase",
                    "image": f"{size.width}x{size.height}",
                    "training views": len(scene.train_frames),
                    "splats": end.splats,
                    "threads": default_threads(),
                }
                results.append(Result("training", end.seconds, "s", settings))
                results.append(Result("held-out PSNR", end.psnr, "dB", settings))
    return results
