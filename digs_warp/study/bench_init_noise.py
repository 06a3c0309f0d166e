"""`digs-warp bench init-noise`: every strategy at every strength of sensor noise, against the true surface.

Poses come from a structure-from-motion model that is made from the truth, in an arbitrary unit. Its scale is
recovered from the noisy depth, so a wrong scale shows in the distances as well. Then two calibration errors:
a baseline that is 5 % too large, which the scale absorbs, and disparities that are 0.2 px too large, which no
scale can absorb.
"""

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.posed_frames import with_cameras
from digs_warp.data.sfm_model import SfmModel
from digs_warp.init.config import InitConfig
from digs_warp.init.local_scales import local_scales
from digs_warp.init.recipes import initialize
from digs_warp.init.scale import estimate_scale
from digs_warp.init.strategies import StrategyName
from digs_warp.record.progress import progress
from digs_warp.sim.config import SimulateConfig
from digs_warp.study.init_cases import InitCase, render_case, training_frames
from digs_warp.study.results import Result
from digs_warp.study.scenes import OBJECT_SIZE, sample_data, voxel_size
from digs_warp.study.synthetic_sfm import (
    sfm_from_truth,
    with_disparity_offset,
    with_wrong_baseline,
)

STRENGTHS = (0.0, 1.0, 2.0, 4.0)
STRATEGIES: tuple[StrategyName, ...] = ("default", "random", "depth", "highdepth", "fusion")
SFM_PER_METRE = 1.37

MESHES = ("ycb_mustard_bottle",)
ENVIRONMENT = "forest_slope"
FRAMES, WIDTH = 24, 640

WRONG_BASELINE = 1.05
DISPARITY_OFFSET = 0.2  # [px]


@dataclass(frozen=True, eq=False)
class ScaledCapture:
    """A capture seen through structure from motion: its training frames in recovered metres.

    Attributes:
        frames: training frames with the model's cameras.
        sfm: the model in recovered metres.
        sfm_per_metre: the recovered scale.
        true_per_metre: true metres per recovered metre.
    """

    frames: list[Frame]
    sfm: SfmModel
    sfm_per_metre: float
    true_per_metre: float


def scaled(capture: Capture, sfm: SfmModel, true_scale: float) -> ScaledCapture:
    """Put the training frames into recovered metres.

    Args:
        capture: gives the depth that tells the scale.
        sfm: the model in [sfm].
        true_scale: what the scale should be [sfm / m].
    """
    frames = training_frames(capture)
    found = estimate_scale(local_scales(sfm, frames, InitConfig())).sfm_per_metre
    metric = sfm.in_metres(found)
    return ScaledCapture(with_cameras(frames, metric), metric, found, found / true_scale)


def bench_init_noise(
    data: Path | None = None, meshes: Sequence[str] = MESHES, frames: int = FRAMES
) -> list[Result]:
    """Return points, distances [mm] and scale error of all strategies at all strengths.

    Args:
        data: folder of the sample data; None: DIGS_WARP_SAMPLE_DATA or ../shared/data.
        meshes: names of sample meshes that follow the built-in object, where they are there.
        frames: of each recording; every eighth is held out.
    """
    data = data or sample_data()
    present = [mesh for mesh in meshes if (data / "meshes" / mesh).is_dir()]
    configs = [
        SimulateConfig(frames=frames, width=WIDTH, samples_per_pixel=1),
        *(sample_recording(data, mesh, frames) for mesh in present),
    ]
    results: list[Result] = []
    with tempfile.TemporaryDirectory() as folder:
        for config in configs:
            results += _of_case(render_case(config, Path(folder)))
    return results


def sample_recording(data: Path, mesh: str, frames: int) -> SimulateConfig:
    """Return the recording of a sample mesh in a textured surround."""
    return SimulateConfig(
        mesh=data / "meshes" / mesh / f"{mesh}.glb",
        environment=data / "envs" / ENVIRONMENT / f"{ENVIRONMENT}_1k.hdr",
        object_size=OBJECT_SIZE,
        frames=frames,
        width=WIDTH,
        samples_per_pixel=1,
    )


def _of_case(case: InitCase) -> Iterator[Result]:
    sfm = sfm_from_truth(case.capture(0.0).frames, SFM_PER_METRE)
    with progress(len(STRENGTHS) + 2, case.name, "sensor") as bar:
        for strength in STRENGTHS:
            yield from _all_strategies(case, case.capture(strength), sfm, f"noise x {strength:g}")
            bar.update()
        stretched = case.with_depth(
            "baseline", lambda depth: with_wrong_baseline(depth, WRONG_BASELINE)
        )
        yield from _all_strategies(case, stretched, sfm, "baseline + 5 %")
        bar.update()
        offset = case.with_depth(
            "offset",
            lambda depth: with_disparity_offset(depth, DISPARITY_OFFSET, case.focal_baseline),
        )
        yield from _all_strategies(case, offset, sfm, "disparity + 0.2 px")
        bar.update()


def _all_strategies(
    case: InitCase, capture: Capture, sfm: SfmModel, sensor: str
) -> Iterator[Result]:
    seen = scaled(capture, sfm, SFM_PER_METRE)
    for strategy in STRATEGIES:
        config = InitConfig(strategy=strategy, voxel_size=voxel_size(strategy))
        found = initialize(seen.frames, config, seen.sfm)
        # The true metre: what the scale got wrong stays wrong relative to the object's size.
        score = case.score(found.points.points_world * np.float32(seen.true_per_metre))
        labels = {"object": case.name, "sensor": sensor, "strategy": strategy}
        values = {
            "points": len(found.points),
            "Chamfer [mm]": 1e3 * score.chamfer,
            "to surface [mm]": 1e3 * score.accuracy,
            "median [mm]": 1e3 * score.accuracy_median,
            "from surface [mm]": 1e3 * score.completeness,
            "F-score 5 mm": score.f_score,
            "scale error": seen.true_per_metre - 1.0,
        }
        yield Result(labels, values)
