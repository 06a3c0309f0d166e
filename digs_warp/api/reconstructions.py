"""`reconstruct`: a recording in memory or on disk -> a reconstruction."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from digs_warp.api.settings import with_settings
from digs_warp.checks import DigsError
from digs_warp.commands.output import reconstruction_files
from digs_warp.commands.reconstruction_options import ReconstructionOptions
from digs_warp.data.capture import Capture, read_capture
from digs_warp.init.strategies import StrategyChoice
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.record.layout import RUN_RECORD
from digs_warp.record.replacement import check_place


def reconstruct(
    capture: Capture | Path | str,
    out: Path | str | None = None,
    *,
    strategy: StrategyChoice | None = None,
    iterations: int | None = None,
    seed: int = 0,
    resume: bool = False,
    **settings: Any,
) -> Reconstruction:
    """Reconstruct a recording as Gaussian splats.

        result = reconstruct(capture, iterations=300, voxel_size=0.005)
        view = result.render(camera)
        result.save_usd("scene.usdz")

    Args:
        capture: a recording, or its folder.
        out: folder for everything that the reconstruction leaves behind
            (docs/formats.md). Default: none is kept.
        strategy: which points to start from. Default: those from depth, or sparse ones where there is none.
        iterations: training steps. Default: 1000.
        seed: decides everything random.
        resume: with ``out``: continue an interrupted run with the same settings.
        settings: any other flag of ``digs-warp reconstruct``, with underscores: ``poses="sfm"``,
            ``masks="depth"``, ``density="adaptive"``, ``time_budget=60.0`` (seconds), ...

    Raises:
        DigsError: a capture that cannot be used, a wrong setting, or a folder that holds results or other
            files with names that a reconstruction needs.
    """
    from digs_warp.pipeline import reconstruct as pipeline

    named = {"strategy": strategy, "iterations": iterations}
    settings |= {name: value for name, value in named.items() if value is not None}
    options = with_settings(ReconstructionOptions(), settings)
    if not isinstance(capture, Capture):
        capture = read_capture(Path(capture))
    config = options.reconstruct_config(seed, capture)
    if out is not None:
        if (Path(out) / RUN_RECORD).exists() and not resume:
            raise DigsError(
                f"'{out}': the folder already holds results; go on with resume=True if they are of a run "
                "that was cut off, or choose another folder"
            )
        if not resume:
            check_place(Path(out), reconstruction_files())
        return pipeline.reconstruct(capture, config, Path(out), resume)
    with TemporaryDirectory(prefix="digs-warp-") as folder:
        return pipeline.reconstruct(capture, config, Path(folder)).in_memory()
