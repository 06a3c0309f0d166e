"""`digs-warp bench realism`: does the simulated sensor err where real matching errs, and in the same way?

The yardstick is the `matcher` tier on the same two images. Each tier is compared with it on one frame of
every sample mesh (the built-in object where there is no sample data), at two image sizes. The matcher under
other image noise is a separate row. The environments take turns, so that texture and light differ.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from digs_warp.record.progress import progress
from digs_warp.sim.config import SimulateConfig, Tier
from digs_warp.sim.sensor.color.recorded import recorded_images
from digs_warp.sim.sensor.facts import measure_facts
from digs_warp.sim.sensor.frame import FrameTruth, Sensed
from digs_warp.sim.sensor.tiers import sense
from digs_warp.sim.sensor_plan import SensorPlan, plan_for_facts
from digs_warp.sim.session import load_inputs, prepare_session
from digs_warp.sim.shutter import Shutter
from digs_warp.study.error_patches import auc_of_classifier, patch_features
from digs_warp.study.realism_scores import (
    agreement,
    bad_share,
    median_where_most,
    repeated_bad,
    small_hole_share,
    temporal_share,
)
from digs_warp.study.results import Result
from digs_warp.study.scenes import OBJECT_SIZE, sample_data

WIDTHS = (640, 1280)
FRAMES = 60  # of the walk
NUMBER = 17  # the one that is taken
DRAWS = 8  # of the image noise, for what changes from frame to frame

SENSORS: tuple[Tier, ...] = ("guided",)
YARDSTICK, OTHER_NOISE = "matcher", "matcher, other noise"


@dataclass(frozen=True, eq=False)
class Scene:
    """A frame, and what sensors measure on it.

    Attributes:
        name: of the mesh.
        truth: of the frame.
        mask: of the object, (height, width), bool.
        plans: of each tier.
    """

    name: str
    truth: FrameTruth
    mask: np.ndarray
    plans: dict[Tier, SensorPlan]

    def sense(self, tier: Tier, draw: int = 0) -> Sensed:
        """Return what a tier measures under one draw of the image noise."""
        plan = self.plans[tier]
        recorded = recorded_images(self.truth, plan.pixel_effects, draw)
        # The yardstick has neither calibration errors nor filters: both are left out.
        return sense(self.truth, tier, (), draw, recorded=recorded)


def bench_realism(data: Path | None = None, widths: Sequence[int] = WIDTHS) -> list[Result]:
    """Return how tiers agree with the matcher, how they change from frame to frame, and their confidence.

    Args:
        data: folder of the sample data; None: DIGS_WARP_SAMPLE_DATA or ../shared/data.
        widths: of the rendered images [px]; what changes from frame to frame is measured at the first.
    """
    meshes = _meshes(data or sample_data())
    results: list[Result] = []
    with progress(len(widths) * len(meshes), "Comparing", "frame") as bar:
        for width in widths:
            scenes = []
            for mesh, environment in meshes:
                scenes.append(_scene(mesh, environment, width))
                results += _scene_results(scenes[-1], width)
                bar.update()
            if len(scenes) > 1:
                results += _classifier_results(scenes, width)
            if width == widths[0]:
                results += [*_temporal_results(scenes), *_confidence_results(scenes)]
    return [*_summary(results, widths), *results]


def _meshes(data: Path) -> list[tuple[Path | None, Path | None]]:
    """Return the sample meshes, each with one of the environments in turn; else the built-in object."""
    meshes = sorted(data.glob("meshes/*/*.glb"))
    environments = [None, *sorted(data.glob("envs/*/*.hdr"))]
    turns: list[tuple[Path | None, Path | None]] = [
        (mesh, environments[i % len(environments)]) for i, mesh in enumerate(meshes)
    ]
    return turns or [(None, None)]


def _scene(mesh: Path | None, environment: Path | None, width: int) -> Scene:
    def config(tier: Tier) -> SimulateConfig:
        return SimulateConfig(
            mesh=mesh,
            environment=environment,
            object_size=None if mesh is None else OBJECT_SIZE,
            width=width,
            frames=FRAMES,
            tier=tier,
        )

    session = prepare_session(config("matcher"), load_inputs(config("matcher")))
    truth, mask = session.truth(NUMBER, Shutter())
    facts = measure_facts([truth])
    tiers: tuple[Tier, ...] = (*SENSORS, "matcher")
    plans: dict[Tier, SensorPlan] = {
        tier: plan_for_facts(facts, session.rig, config(tier)) for tier in tiers
    }
    return Scene(mesh.stem if mesh else "built-in", truth, mask > 127, plans)


def _scene_results(scene: Scene, width: int) -> Iterator[Result]:
    """Yield the agreement of each sensor with the matcher on one scene."""
    truth = scene.truth
    yardstick = scene.sense("matcher").disparity
    sensors: dict[str, Callable[[], Sensed]] = {
        **{tier: lambda tier=tier: scene.sense(tier) for tier in SENSORS},
        OTHER_NOISE: lambda: scene.sense("matcher", draw=1),
        YARDSTICK: lambda: scene.sense("matcher"),
    }
    for name, measure in sensors.items():
        disparity = measure().disparity
        failures, rms = agreement(disparity, yardstick, truth.disparity)
        yield Result(
            {"width": width, "scene": scene.name, "sensor": name},
            {
                "failures": failures,
                "rms": rms,
                "bad-1, object": bad_share(disparity, truth.disparity, scene.mask),
                "bad-1, surround": bad_share(disparity, truth.disparity, ~scene.mask),
                "fill": float(np.isfinite(disparity).mean()),
                "small holes": small_hole_share(disparity),
            },
            "scenes",
        )


def _summary(results: Sequence[Result], widths: Sequence[int]) -> Iterator[Result]:
    """Yield one row per width and sensor: means over the scenes, ratios to the matcher."""
    rows = [result for result in results if result.table == "scenes"]
    classified = {
        (r.labels["width"], r.labels["sensor"]): r.values["AUC"]
        for r in results
        if r.table == "classifier"
    }
    for width in widths:
        here = [r for r in rows if r.labels["width"] == width]
        yardstick = {r.labels["scene"]: r.values for r in here if r.labels["sensor"] == YARDSTICK}
        for name in (*SENSORS, OTHER_NOISE, YARDSTICK):
            mine = {r.labels["scene"]: r.values for r in here if r.labels["sensor"] == name}

            def column(key: str, of: dict = mine) -> np.ndarray:
                return np.array([values[key] for values in of.values()])

            values = {
                "rank correlation of failures": float(column("failures").mean()),
                "of RMS": float(column("rms").mean()),
            }
            for part in ("object", "surround"):
                ratio = column(f"bad-1, {part}") / column(f"bad-1, {part}", yardstick)
                values[f"bad-1 / matcher's, {part}"] = float(np.exp(np.log(ratio).mean()))
                values[f"worst, {part}"] = float(ratio[np.abs(np.log(ratio)).argmax()])
            values["fill"] = float(column("fill").mean())
            values["hole area in up to 3 px"] = float(column("small holes").mean())
            if (width, name) in classified:
                values["classifier's AUC"] = classified[width, name]
            yield Result({"width": width, "sensor": name}, values, "agreement")


def _classifier_results(scenes: Sequence[Scene], width: int) -> Iterator[Result]:
    """Yield how well a classifier tells each sensor's errors from the matcher's; 0.5: not at all."""

    def features(tier: Tier, draw: int = 0) -> list[np.ndarray]:
        return [patch_features(s.sense(tier, draw).disparity - s.truth.disparity) for s in scenes]

    yardstick = features("matcher")
    for name in (*SENSORS, OTHER_NOISE):
        other = features("matcher", 1) if name == OTHER_NOISE else features(name)
        auc = auc_of_classifier(other, yardstick)
        yield Result({"width": width, "sensor": name}, {"AUC": auc}, "classifier")


def _temporal_results(scenes: Sequence[Scene]) -> Iterator[Result]:
    """Yield what changes from frame to frame when only the noise does; means over the scenes."""
    for tier in (*SENSORS, YARDSTICK):
        rows = []
        for scene in scenes:
            stack = np.stack([scene.sense(tier, draw).disparity for draw in range(DRAWS)])
            true = scene.truth.disparity
            median = median_where_most(stack)
            everywhere = np.ones(true.shape, bool)
            rows.append(
                {
                    "temporal share of the variance": temporal_share(stack, true),
                    "bad pixels bad in the next frame": repeated_bad(stack, true),
                    "bad-1 of a frame": bad_share(stack[0], true, everywhere),
                    f"bad-1 of the median of {DRAWS}": bad_share(median, true, everywhere),
                }
            )
        means = {key: float(np.mean([row[key] for row in rows])) for key in rows[0]}
        yield Result({"sensor": tier}, means, "frames")


def _confidence_results(scenes: Sequence[Scene]) -> Iterator[Result]:
    """Yield the share of right matches at each confidence, over all scenes."""
    edges = (0.0, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98, 1.0001)
    for tier in SENSORS:
        pairs = []
        for scene in scenes:
            sensed = scene.sense(tier)
            known = sensed.known & np.isfinite(scene.truth.disparity)
            right = np.abs(sensed.disparity - scene.truth.disparity) <= 1
            pairs.append(np.stack([sensed.confidence[known], right[known]]))
        confidence, right = np.concatenate(pairs, axis=1)
        for low, high in pairwise(edges):
            there = (confidence >= low) & (confidence < high)
            if not there.any():
                continue
            yield Result(
                {"sensor": tier, "confidence": f"{low:g} to {min(high, 1):g}"},
                {
                    "share of the matches": float(there.mean()),
                    "mean confidence": float(confidence[there].mean()),
                    "right": float(right[there].mean()),
                },
                "confidence",
            )
