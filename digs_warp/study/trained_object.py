"""The built-in object, recorded and trained for a while: what files, films and meshes are measured on."""

import tempfile
from dataclasses import dataclass
from pathlib import Path

from digs_warp.camera import Camera
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.triangle_mesh import TriangleMesh
from digs_warp.init.config import InitConfig
from digs_warp.init.recipes import initial_points
from digs_warp.init.seed_gaussians import seed_gaussians
from digs_warp.record.progress import progress
from digs_warp.surface.true_surface import read_true_surface
from digs_warp.train.config import TrainConfig
from digs_warp.train.trainer import Trainer
from digs_warp.train.view_store import open_views

FRAMES = 48
SIZE = (640, 360)
STEPS = 400
SH_DEGREE = 3


@dataclass(frozen=True, eq=False)
class TrainedObject:
    """The Gaussians, where they were seen from, and the surface that they stand for."""

    gaussians: Gaussians
    cameras: list[Camera]
    surface: TriangleMesh


def trained_object(
    frames: int = FRAMES, size: tuple[int, int] = SIZE, steps: int = STEPS
) -> TrainedObject:
    """Record ``frames`` images of ``size`` [px], start from their depth and train; always the same."""
    from digs_warp.sim.record import SimulateConfig, simulate

    width, height = size
    recording = SimulateConfig(
        frames=frames, width=width, height=height, samples_per_pixel=1, tier="law"
    )
    init = InitConfig()
    train = TrainConfig(iterations=steps, sh_degree=SH_DEGREE)
    with tempfile.TemporaryDirectory() as folder:
        capture = simulate(recording, Path(folder) / "capture")
        surface = read_true_surface(capture.folder)
        assert surface is not None  # it was simulated
        points = initial_points(capture.frames, init)
        seeds = seed_gaussians(points, train.sh_degree, init.seed_opacity, init.seed_width)
        trainer = Trainer(seeds, open_views(capture.frames, train), train)
        with progress(steps, "Training", "step") as bar:
            for _ in range(steps):
                trainer.step()
                bar.update()
        cameras = [frame.camera for frame in capture.frames]
        return TrainedObject(trainer.gaussians.to_numpy(), cameras, surface)
