"""`python -m studies init-noise`: every strategy at every strength of sensor noise, against the true surface.

Poses come from a structure-from-motion model that is made from the truth, in an arbitrary unit. Its scale is
recovered from the noisy depth, so a wrong scale shows in the distances as well.
"""

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
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
from digs_warp.measure.surface_metrics import surface_score
from digs_warp.record.progress import progress
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.record import simulate
from digs_warp.study.engine.synthetic_sfm import sfm_from_truth
from digs_warp.study.scenes import OBJECT_SIZE, sample_data, voxel_size
from digs_warp.surface.true_surface import read_true_surface
from studies.results import Result

STRENGTHS = (0.0, 1.0, 2.0, 4.0)
STRATEGIES: tuple[StrategyName, ...] = ("default", "random", "depth", "highdepth", "fusion")
SFM_PER_METRE = 1.37

MESHES = ("ycb_mustard_bottle",)
ENVIRONMENT = "forest_slope"
FRAMES, WIDTH = 24, 640
# Points within this distance [m] of the true surface count as on it.
THRESHOLD = 0.005


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
    frames, _ = capture.split()
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
    recording = SimulateConfig(frames=frames, width=WIDTH, samples_per_pixel=1)
    configs = {"built-in": recording}
    for mesh in meshes:
        file = data / "meshes" / mesh / f"{mesh}.glb"
        surround = data / "envs" / ENVIRONMENT / f"{ENVIRONMENT}_1k.hdr"
        if file.is_file():
            configs[mesh] = replace(
                recording, mesh=file, environment=surround, object_size=OBJECT_SIZE
            )
    results = []
    with progress(len(configs) * len(STRENGTHS), "Measuring", "sensor") as bar:
        for name, config in configs.items():
            for strength in STRENGTHS:
                with tempfile.TemporaryDirectory() as folder:
                    capture = simulate(replace(config, strength=strength), Path(folder) / "capture")
                    labels = {"object": name, "sensor": f"noise x {strength:g}"}
                    results += list(_all_strategies(capture, labels))
                bar.update()
    return results


def _all_strategies(capture: Capture, labels: dict[str, str]) -> Iterator[Result]:
    truth = read_true_surface(capture.folder)
    assert truth is not None  # it was simulated
    seen = scaled(capture, sfm_from_truth(capture.frames, SFM_PER_METRE), SFM_PER_METRE)
    for strategy in STRATEGIES:
        config = InitConfig(strategy=strategy, voxel_size=voxel_size(strategy))
        found = initialize(seen.frames, config, seen.sfm)
        # The true metre: what the scale got wrong stays wrong relative to the object's size.
        points = found.points.points_world * np.float32(seen.true_per_metre)
        score = surface_score(points, truth, THRESHOLD)
        values = {
            "points": len(found.points),
            "Chamfer [mm]": 1e3 * score.chamfer,
            "to surface [mm]": 1e3 * score.accuracy,
            "median [mm]": 1e3 * score.accuracy_median,
            "from surface [mm]": 1e3 * score.completeness,
            "F-score 5 mm": score.f_score,
            "scale error": seen.true_per_metre - 1.0,
        }
        yield Result(labels | {"strategy": strategy}, values)
