"""`python -m studies training`: quality of held-out views over training time, by learning rates.

The built-in object is recorded with the depth law of a stereo camera (not timed) and initialized from
its depth with the true poses. From there it is trained with the settings for a dense start and with those of
3DGS.
"""

import tempfile
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from digs_warp.data.frame import Frame
from digs_warp.data.point_cloud import PointCloud
from digs_warp.device.threads import default_threads
from digs_warp.init.config import InitConfig
from digs_warp.init.recipes import initial_points
from digs_warp.init.seeds import seed_gaussians
from digs_warp.init.strategies import STRATEGIES
from digs_warp.record.progress import progress
from digs_warp.study.charts import Chart, Curve
from digs_warp.train.config import REFERENCE_RATES, Rates, Stop, TrainConfig
from digs_warp.train.evaluate import TestView, load_test_views, render_views, score_views
from digs_warp.train.trainer import Trainer
from digs_warp.train.view_store import open_views
from studies.results import Result


@dataclass(frozen=True)
class SceneSize:
    """Size of a recording and of its start: image [px], frames, edge of the voxels [m]."""

    width: int
    height: int
    frames: int
    voxel_size: float

    @property
    def image(self) -> str:
        """The image size as tables show it."""
        return f"{self.width}x{self.height}"


CONVERGENCE_SIZE = SceneSize(960, 540, frames=32, voxel_size=0.003)
CONVERGENCE_ITERATIONS = 300
MEASURE_AT = (0, 10, 25, 50, 100, 150, 200, 300)
DENSE, REFERENCE = "dense start", "3DGS"


def bench_convergence(
    size: SceneSize = CONVERGENCE_SIZE, iterations: int = CONVERGENCE_ITERATIONS
) -> list[Result]:
    """Return seconds and PSNR of the held-out views along a run: our settings, then those of 3DGS."""
    dense = TrainConfig(stop=Stop(iterations=iterations))
    reference = replace(dense, rates=Rates(**asdict(REFERENCE_RATES)))
    init = InitConfig()
    runs: tuple[tuple[str, TrainConfig, Mapping[str, float]], ...] = (
        (DENSE, dense, {"opacity": init.seed_opacity, "width": init.seed_width}),
        (REFERENCE, reference, {"opacity": STRATEGIES["default"].opacity}),
    )
    results = []
    with _recorded(size) as scene, progress(len(runs), "Training", "run") as bar:
        for name, config, start in runs:
            shared = {"image": size.image, "splats": len(scene.points)}
            shared |= {"threads": default_threads(), "settings": name}
            results += [
                Result(
                    shared | {"iteration": at.iteration},
                    {"seconds": round(at.seconds, 2), "PSNR on the object [dB]": at.psnr},
                    "convergence",
                )
                for at in scene.train(config, MEASURE_AT, start=start)
            ]
            bar.update()
    return results


def convergence_charts(results: Sequence[Result]) -> list[Chart]:
    """Return quality against seconds and against iterations."""
    results = [result for result in results if result.table == "convergence"]
    names = dict.fromkeys(result.labels["settings"] for result in results)
    curves = {name: [r for r in results if r.labels["settings"] == name] for name in names}
    first = results[0].labels
    title = f"{first['splats']:,} Gaussians from depth, {first['image']} px"
    x_labels = {"seconds": "training time [s]", "iteration": "iterations"}
    psnr = "PSNR on the object [dB]"
    charts = []
    for key, x_label in x_labels.items():
        drawn = [
            Curve(
                name, [{**r.labels, **r.values}[key] for r in rows], [r.values[psnr] for r in rows]
            )
            for name, rows in curves.items()
        ]
        y_label = "PSNR on the object, held-out views [dB]"
        about = f"{title}, {first['threads']} threads"
        charts.append(Chart(f"convergence_{key}", about, drawn, x_label, y_label))
    return charts


@dataclass(frozen=True)
class Milestone:
    """State of a run: steps taken, training seconds, PSNR of the held-out views [dB], Gaussians."""

    iteration: int
    seconds: float
    psnr: float
    splats: int


@dataclass(frozen=True)
class _Scene:
    """A recording split into training frames and held-out views, and the points that its depth gives."""

    frames: list[Frame]
    test_views: Sequence[TestView]
    points: PointCloud

    def train(
        self,
        config: TrainConfig,
        measure_at: Collection[int] = (),
        start: Mapping[str, float] | None = None,
    ) -> list[Milestone]:
        """Train, and measure at some iterations and at the end; measuring takes no training seconds.

        Args:
            config: of the training.
            measure_at: iterations.
            start: opacity and width of the first Gaussians; default: those for a dense start.
        """
        init = InitConfig()
        start = start or {"opacity": init.seed_opacity, "width": init.seed_width}
        seeds = seed_gaussians(self.points, config.usual_sh_degree, **start)
        views = open_views(self.frames, config)
        trainer = Trainer(seeds, views, config)
        milestones = []
        for step in range(config.stop.iterations + 1):
            if step in measure_at or step == config.stop.iterations:
                renderings = render_views(trainer.gaussians, self.test_views)
                scores = score_views(renderings, self.test_views)
                psnr = np.mean([score.psnr_object for score in scores])
                splats = len(trainer.gaussians)
                milestones.append(Milestone(step, trainer.seconds, float(psnr), splats))
            if step < config.stop.iterations:
                trainer.step()
        views.close()
        return milestones


@contextmanager
def _recorded(size: SceneSize) -> Iterator[_Scene]:
    """Record the built-in object, and initialize from its depth."""
    from digs_warp.sim.record.record import SimulateConfig, simulate

    config = SimulateConfig(frames=size.frames, width=size.width, height=size.height, tier="law")
    with tempfile.TemporaryDirectory() as folder:
        capture = simulate(config, Path(folder) / "capture")
        frames, test_frames = capture.split()
        points = initial_points(frames, InitConfig(voxel_size=size.voxel_size))
        yield _Scene(frames, load_test_views(test_frames), points)
