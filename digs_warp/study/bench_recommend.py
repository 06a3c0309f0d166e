"""`digs-warp bench recommend`: what is recommended for a time, against the best of the front at that time."""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.device.warp_start import compile_seconds
from digs_warp.pipeline.reconstruct import ReconstructConfig, reconstruct
from digs_warp.record.progress import progress
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.record import simulate
from digs_warp.study.engine.case import with_settings
from digs_warp.study.recommend.choose import Choice, Recommendation, Studies, recommend
from digs_warp.study.recommend.published import read_studies
from digs_warp.study.results import Result
from digs_warp.study.scenes import with_meshes
from digs_warp.words import did_you_mean

# The first two are those of the trade-off study, at another size; the others were kept aside.
MESHES = ("ycb_mustard_bottle", "avocado")
KEPT_ASIDE = ("ycb_cracker_box", "flight_helmet", "tea_set", "boot_plain")

FRAMES, WIDTH = 24, 320
# Times for a reconstruction [s].
BUDGETS = (8.0, 15.0, 30.0, 60.0)
# Enough for all settings.
ANY_TIME = 1e6


@dataclass(frozen=True)
class Run:
    """A setting as it was run: its time without compiling kernels [s], and PSNR on the object [dB]."""

    choice: Choice
    seconds: float
    psnr: float


def bench_recommend(
    meshes: Sequence[str] = (),
    data: Path | None = None,
    recording: SimulateConfig | None = None,
    budgets: Sequence[float] = BUDGETS,
    studies: Studies | None = None,
) -> list[Result]:
    """Return the recommended setting of every object and time, beside the best that was run.

    Every setting of the front of the study is run once for each object. The best is that of the highest PSNR
    on held-out views among those that took no longer than the time, or than the recommended one did.

    Args:
        meshes: some of `MESHES` and `KEPT_ASIDE`; none: all that are there.
        data: folder of the sample data; None: DIGS_WARP_SAMPLE_DATA or ../shared/data.
        recording: its frames and image size; None: those of the published table.
        budgets: times [s]; where nothing fits, there is no result.
        studies: what the recommendation is made from; None: what `digs-warp recommend` takes.

    Raises:
        DigsError: an unknown mesh, or none is there.
    """
    known = (*MESHES, *KEPT_ASIDE)
    if unknown := [mesh for mesh in meshes if mesh not in known]:
        raise DigsError(
            f"bench recommend: no object '{unknown[0]}'{did_you_mean(unknown[0], known)}"
        )
    recording = recording or SimulateConfig(frames=FRAMES, width=WIDTH)
    scenes = with_meshes(recording, meshes or known, data, "recommend")
    studies = studies or read_studies()
    results = []
    with progress(len(scenes), "Comparing", "object") as bar:
        for mesh, scene in scenes.items():
            with tempfile.TemporaryDirectory(prefix="digs-warp-bench-") as place:
                capture = simulate(scene, Path(place, "capture"))
                found = recommend(capture, ANY_TIME, ReconstructConfig(), studies)
                runs = [_run(capture, choice, Path(place)) for choice in found.front]
            results += compared(mesh, found, runs, budgets)
            bar.update()
    return results


def compared(
    mesh: str, found: Recommendation, runs: Sequence[Run], budgets: Sequence[float]
) -> list[Result]:
    """Return the recommended setting for each time beside the best.

    Args:
        mesh: name of the object.
        found: the settings for any time.
        runs: all settings of its front, as they were run.
        budgets: times [s].
    """
    results = []
    for budget in budgets:
        fitting = [run for run in runs if run.choice.seconds <= budget]
        if not fitting:
            continue
        own = max(fitting, key=lambda run: run.choice.quality)
        rivals = [run for run in runs if run.seconds <= max(budget, own.seconds)]
        best = max(rivals, key=lambda run: run.psnr)
        labels = {
            "object": mesh,
            "kept aside": "no" if mesh in MESHES else "yes",
            "time [s]": f"{budget:g}",
            "recommended": own.choice.setting.name,
            "best": best.choice.setting.name,
        }
        values = {
            "predicted [s]": own.choice.seconds,
            "took [s]": own.seconds,
            "PSNR, object [dB]": own.psnr,
            "best PSNR [dB]": best.psnr,
            "ratio": own.psnr / best.psnr,
            "machine": found.times.machine,
        }
        results.append(Result(labels, values))
    return results


def _run(capture: Capture, choice: Choice, place: Path) -> Run:
    config = with_settings(ReconstructConfig(), choice.settings)
    name = choice.setting.name.replace(" ", "_")
    before = compile_seconds()
    result = reconstruct(capture, config, place / name)
    seconds = sum(result.seconds.values()) - (compile_seconds() - before)
    return Run(choice, seconds, result.scores.mean.psnr_object)
