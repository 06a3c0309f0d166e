"""`reconstruct`: a recording in memory or on disk -> a reconstruction."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from digs_warp.api.settings import with_settings
from digs_warp.checks import DigsError, check_shape
from digs_warp.commands.output import OutputFolder
from digs_warp.commands.reconstruction_options import ReconstructionOptions
from digs_warp.data.capture import Capture, read_capture
from digs_warp.data.frame import Frame
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.point_cloud import PointCloud
from digs_warp.init.config import StrategyChoice
from digs_warp.pipeline.reconstruction import Reconstruction

if TYPE_CHECKING:
    from digs_warp.api.keywords import ReconstructSettings


def reconstruct(
    capture: Capture | Path | str,
    out: Path | str | None = None,
    *,
    strategy: StrategyChoice | None = None,
    iterations: int | None = None,
    seed: int = 0,
    resume: bool = False,
    overwrite: bool = False,
    points: np.ndarray | None = None,
    loss: Callable[[Frame, np.ndarray], tuple[float, np.ndarray]] | None = None,
    callback: Callable[[int, Gaussians], None] | None = None,
    **settings: Unpack["ReconstructSettings"],
) -> Reconstruction:
    """Reconstruct a recording as Gaussian splats.

        result = reconstruct(capture, iterations=300, voxel_size=0.005)
        view = result.render(camera)
        result.save("scene.usdz")

    Args:
        capture: a recording, or its folder.
        out: folder for everything that the reconstruction leaves behind
            (docs/formats.md). Default: none is kept.
        strategy: which points to start from. Default: those from depth, or sparse ones where there is none.
        iterations: training steps. Default: 1000.
        seed: decides everything random.
        resume: with ``out``: continue an interrupted run with the same settings.
        overwrite: with ``out``: replace the results of an earlier run once the new ones are complete.
        points: to start from, in the world of the poses: x, y, z [m], or with red, green, blue in 0..1 as
            well, (n, 3) or (n, 6). At least 100; without colors they begin gray.
        loss: a term to add to the loss. Of a training frame and its rendered image, sRGB, (height, width, 3),
            float32, it returns the value, and the derivative by the image in the image's shape.
        callback: called every few steps with their number and a copy of the Gaussians.
        settings: any other flag of ``digs-warp reconstruct``, with underscores: ``poses="sfm"``,
            ``masks="depth"``, ``density="adaptive"``, ``time_budget=60.0`` (seconds), ...

    Raises:
        DigsError: a capture that cannot be used, a wrong setting, or a folder that is not empty.
    """
    from digs_warp.pipeline import reconstruct as pipeline
    from digs_warp.train.session import Hooks

    if not isinstance(capture, Capture):
        capture = read_capture(Path(capture))
    if points is not None:
        if settings.get("poses", "capture") != "capture" or strategy not in (None, "default"):
            raise DigsError(
                "points: they are in the world of the recorded poses, and what is started from; leave out "
                "poses and strategy"
            )
        capture, strategy = replace(capture, points=_cloud(points)), "default"
    named = {"strategy": strategy, "iterations": iterations}
    given = {name: value for name, value in named.items() if value is not None}
    options = with_settings(ReconstructionOptions(), {**settings, **given})
    config = options.reconstruct_config(seed, capture)

    def watch(step: int, gaussians: Any) -> None:
        if callback is not None:
            callback(step, gaussians.to_numpy())

    hooks = Hooks(watch, loss)
    if out is None:
        with TemporaryDirectory(prefix="digs-warp-") as folder:
            return pipeline.reconstruct(capture, config, Path(folder), hooks=hooks).in_memory()
    output = OutputFolder(out=Path(out), resume=resume, overwrite=overwrite)
    with output.opened([capture.stored_in]) as folder:
        result = pipeline.reconstruct(capture, config, folder, resume, hooks)
    return Reconstruction.load(Path(out), capture) if overwrite else result


def _cloud(points: np.ndarray) -> PointCloud:
    """Return rows of x, y, z, and maybe red, green, blue, as points."""
    rows = check_shape("points", np.asarray(points, dtype=np.float32), (None, None))
    if rows.shape[1] not in (3, 6):
        raise DigsError(f"points: shape {rows.shape}, expected (n, 3) or (n, 6)")
    colors = rows[:, 3:] if rows.shape[1] == 6 else np.full_like(rows, 0.5)
    return PointCloud(rows[:, :3], colors)
