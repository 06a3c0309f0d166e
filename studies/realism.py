"""`python -m studies realism`: does the simulated sensor err where real matching errs, and in the same way?

The yardstick is the `matcher` tier on the same two images. The default sensor is compared with it on one
frame of every sample mesh (the built-in object where there is no sample data), at two image sizes. The
matcher under other image noise is a separate row. The environments take turns, so that texture and light
differ. Scenes that were kept aside when constants were chosen are a row of their own. Of the matches that the
sensor is so sure of, how many are right?
"""

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from digs_warp.record.progress import progress
from digs_warp.sim.sensor.error_attribution import WRONG
from digs_warp.sim.sensor.filters import gray_of
from digs_warp.sim.sensor.guided.confidence import confidence_of
from digs_warp.sim.sensor.guided.search import search
from digs_warp.sim.sensor.matcher import search_range
from digs_warp.study.scenes import sample_data
from studies.error_patches import auc_of_classifier, patch_features
from studies.realism_scenes import Scene, places
from studies.realism_scores import (
    agreement,
    bad_share,
    median_where_most,
    repeated_bad,
    small_hole_share,
    temporal_share,
)
from studies.results import Result

WIDTHS = (640, 1280)
MATCHES = 30_000  # of each scene, drawn to see how many are right
SURE = (0.0, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98, 1.0)  # ranges of confidence
DRAWS = 8  # of the image noise, for what changes from frame to frame

SENSOR, YARDSTICK, OTHER_NOISE = "guided", "matcher", "matcher, other noise"
KEPT_ASIDE = "guided, scenes kept aside"


def bench_realism(data: Path | None = None, widths: Sequence[int] = WIDTHS) -> list[Result]:
    """Return how the default sensor agrees with the matcher, and what changes between frames.

    Args:
        data: folder of the sample data; None: DIGS_WARP_SAMPLE_DATA or ../shared/data.
        widths: of the rendered images [px]; changes between frames are measured at the first.
    """
    chosen = places(data or sample_data())
    results: list[Result] = []
    classifiers: dict[tuple[int, str], float] = {}
    matches: dict[bool, list[np.ndarray]] = {True: [], False: []}
    with progress(len(widths) * len(chosen), "Comparing", "frame") as bar:
        for width in widths:
            scenes, patches = [], {name: [] for name in (SENSOR, OTHER_NOISE, YARDSTICK)}
            for place in chosen:
                scene = place.scene(width)
                scenes.append(scene)
                sensed = _sensed(scene)
                results += _scene_results(scene, sensed, width)
                matches[place.tuned].append(_matches(scene))
                for name, disparity in sensed.items():
                    patches[name].append(patch_features(disparity - scene.truth.disparity))
                bar.update()
            for name in (SENSOR, OTHER_NOISE) if len(scenes) > 1 else ():
                classifiers[width, name] = auc_of_classifier(patches[name], patches[YARDSTICK])
            if width == widths[0]:
                results += _temporal_results(scenes)
    return [*_summary(results, classifiers, widths), *results, *_calibration(matches)]


def _sensed(scene: Scene) -> dict[str, np.ndarray]:
    return {
        SENSOR: scene.sense("guided").disparity,
        OTHER_NOISE: scene.sense("matcher", draw=1).disparity,
        YARDSTICK: scene.sense("matcher").disparity,
    }


def _scene_results(scene: Scene, sensed: dict[str, np.ndarray], width: int) -> Iterator[Result]:
    """Yield the agreement of each sensor with the matcher on one scene."""
    true = scene.truth.disparity
    for name, disparity in sensed.items():
        failures, rms = agreement(disparity, sensed[YARDSTICK], true)
        yield Result(
            {"width": width, "scene": scene.name, "tuned": scene.tuned, "sensor": name},
            {
                "failures": failures,
                "rms": rms,
                "bad-1, object": bad_share(disparity, true, scene.mask),
                "bad-1, surround": bad_share(disparity, true, ~scene.mask),
                "fill": float(np.isfinite(disparity).mean()),
                "small holes": small_hole_share(disparity),
            },
            "scenes",
        )


def _summary(
    results: Sequence[Result], classifiers: dict[tuple[int, str], float], widths: Sequence[int]
) -> Iterator[Result]:
    """Yield one row per width and sensor: means over the scenes, ratios to the matcher."""
    rows = [result for result in results if result.table == "scenes"]
    some_aside = any(r.labels["tuned"] for r in rows)
    for width in widths:
        here = [r for r in rows if r.labels["width"] == width]
        yardstick = {r.labels["scene"]: r.values for r in here if r.labels["sensor"] == YARDSTICK}
        for name in (SENSOR, *[KEPT_ASIDE] * some_aside, OTHER_NOISE, YARDSTICK):
            mine = [r for r in here if r.labels["sensor"] == name]
            if name == KEPT_ASIDE:
                mine = [r for r in here if r.labels["sensor"] == SENSOR and not r.labels["tuned"]]
            values = _mean_agreement(mine, yardstick)
            if (width, name) in classifiers:
                values["classifier's AUC"] = classifiers[width, name]
            yield Result({"width": width, "sensor": name}, values, "agreement")


def _mean_agreement(rows: Sequence[Result], yardstick: dict) -> dict[str, float]:
    def column(key: str) -> np.ndarray:
        return np.array([row.values[key] for row in rows])

    values = {
        "rank correlation of failures": float(column("failures").mean()),
        "of RMS": float(column("rms").mean()),
    }
    for part in ("object", "surround"):
        key = f"bad-1, {part}"
        ratio = column(key) / [yardstick[row.labels["scene"]][key] for row in rows]
        values[f"bad-1 / matcher's, {part}"] = float(np.exp(np.log(ratio).mean()))
        values[f"worst, {part}"] = float(ratio[np.abs(np.log(ratio)).argmax()])
    values["fill"] = float(column("fill").mean())
    values["hole area in up to 3 px"] = float(column("small holes").mean())
    return values


def _temporal_results(scenes: Sequence[Scene]) -> Iterator[Result]:
    """Yield what changes from frame to frame when only the noise does; means over the scenes."""
    for tier in ("guided", "matcher"):
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


def _matches(scene: Scene) -> np.ndarray:
    """Return the confidence in some matches within the range of the camera, and whether they are right."""
    rig, true = scene.truth.rig, scene.truth.disparity
    left, right = map(gray_of, scene.images())
    found = search(left, right, true, search_range(rig), rig.window, smoothness=rig.smoothness)
    sure = confidence_of(left, found.disparity, found.cost, found.rival, rig.window)
    is_far = found.disparity < rig.focal_baseline / rig.max_depth
    known = np.flatnonzero((sure > 0) & ~is_far & np.isfinite(true))
    at = np.random.default_rng(0).choice(known, MATCHES)
    is_right = np.abs(found.disparity - true) <= WRONG
    return np.stack([sure.reshape(-1)[at], is_right.reshape(-1)[at]])


def _calibration(matches: Mapping[bool, Sequence[np.ndarray]]) -> Iterator[Result]:
    """Yield the shares of matches with a confidence, and of those that are right."""
    drawn = {("", ", kept aside")[not tuned]: each for tuned, each in matches.items() if each}
    for low, high in pairwise(SURE):
        values = {}
        for where, each in drawn.items():
            sure, is_right = np.concatenate(each, axis=1)
            here = (sure >= low) & (sure < high)
            values[f"matches{where}"] = float(here.mean())
            values[f"right{where}"] = float(is_right[here].mean())
        yield Result({"confidence": f"{low:g} to {high:g}"}, values, "confidence")
