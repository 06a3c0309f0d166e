"""`digs-warp bench realism`: does the simulated sensor err where real matching errs, and in the same way?

The yardstick is the `matcher` tier on the same two images. The default sensor is compared with it on one
frame of every sample mesh (the built-in object where there is no sample data), at two image sizes. The
matcher under other image noise is a separate row. The environments take turns, so that texture and light
differ. Scenes that were kept aside when constants were chosen are a row of their own.
"""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from digs_warp.record.progress import progress
from digs_warp.sim.record.record import frames_at_once
from digs_warp.sim.sensor.filters import gray_of
from digs_warp.sim.sensor.frame import Sensed
from digs_warp.sim.sensor.matcher import match, search_range
from digs_warp.sim.sensor.tiers import sense
from digs_warp.study.error_patches import auc_of_classifier, patch_features
from digs_warp.study.realism_confidence import confidence_results
from digs_warp.study.realism_regions import region_results
from digs_warp.study.realism_scenes import Scene, places
from digs_warp.study.realism_scores import (
    agreement,
    bad_share,
    median_where_most,
    repeated_bad,
    small_hole_share,
    temporal_share,
)
from digs_warp.study.results import Result
from digs_warp.study.scenes import sample_data
from digs_warp.study.timing import ms_side_by_side

WIDTHS = (640, 1280)
DRAWS = 8  # of the image noise, for what changes from frame to frame

SENSOR, YARDSTICK, OTHER_NOISE = "guided", "matcher", "matcher, other noise"
KEPT_ASIDE = "guided, scenes kept aside"
SEARCH = "matcher, search alone"

TIMED = 3  # every third scene
ROUNDS = 3


def bench_realism(data: Path | None = None, widths: Sequence[int] = WIDTHS) -> list[Result]:
    """Return how the default sensor agrees with the matcher, changes between frames, trusts itself; its time.

    Args:
        data: folder of the sample data; None: DIGS_WARP_SAMPLE_DATA or ../shared/data.
        widths: of the rendered images [px]; changes between frames and confidence are measured at the first,
            time at the last.
    """
    chosen = places(data or sample_data())
    results: list[Result] = []
    with progress(len(widths) * len(chosen), "Comparing", "frame") as bar:
        for width in widths:
            scenes = []
            for place in chosen:
                scenes.append(place.scene(width))
                results += _scene_results(scenes[-1], width)
                results += region_results(scenes[-1], width)
                bar.update()
            if len(scenes) > 1:
                results += _classifier_results(scenes, width)
            if width == widths[0]:
                results += [*_temporal_results(scenes), *confidence_results(scenes)]
            if width == widths[-1]:
                results += _time_results(scenes[::TIMED])
    return [*_summary(results, widths), *results]


def _scene_results(scene: Scene, width: int) -> Iterator[Result]:
    """Yield the agreement of each sensor with the matcher on one scene."""
    true = scene.truth.disparity
    yardstick = scene.sense("matcher").disparity
    sensors = {
        SENSOR: scene.sense("guided").disparity,
        OTHER_NOISE: scene.sense("matcher", draw=1).disparity,
        YARDSTICK: yardstick,
    }
    for name, disparity in sensors.items():
        failures, rms = agreement(disparity, yardstick, true)
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


def _summary(results: Sequence[Result], widths: Sequence[int]) -> Iterator[Result]:
    """Yield one row per width and sensor: means over the scenes, ratios to the matcher."""
    rows = [result for result in results if result.table == "scenes"]
    classified = {
        (r.labels["width"], r.labels["sensor"]): r.values["AUC"]
        for r in results
        if r.table == "classifier"
    }
    some_aside = any(r.labels["tuned"] for r in rows)
    for width in widths:
        here = [r for r in rows if r.labels["width"] == width]
        yardstick = {r.labels["scene"]: r.values for r in here if r.labels["sensor"] == YARDSTICK}
        for name in (SENSOR, *[KEPT_ASIDE] * some_aside, OTHER_NOISE, YARDSTICK):
            mine = [r for r in here if r.labels["sensor"] == name]
            if name == KEPT_ASIDE:
                mine = [r for r in here if r.labels["sensor"] == SENSOR and not r.labels["tuned"]]
            values = _mean_agreement(mine, yardstick)
            if (width, name) in classified:
                values["classifier's AUC"] = classified[width, name]
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


def _classifier_results(scenes: Sequence[Scene], width: int) -> Iterator[Result]:
    """Yield how well a classifier tells each sensor's errors from the matcher's; 0.5: not at all."""

    def features(measure: Callable[[Scene], Sensed]) -> list[np.ndarray]:
        return [patch_features(measure(s).disparity - s.truth.disparity) for s in scenes]

    yardstick = features(lambda scene: scene.sense("matcher"))
    others = {
        SENSOR: features(lambda scene: scene.sense("guided")),
        OTHER_NOISE: features(lambda scene: scene.sense("matcher", draw=1)),
    }
    for name, other in others.items():
        auc = auc_of_classifier(other, yardstick)
        yield Result({"width": width, "sensor": name}, {"AUC": auc}, "classifier")


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


def _time_results(scenes: Sequence[Scene]) -> Iterator[Result]:
    """Yield the time of the sensors on finished images, several frames at once as in a recording; means."""
    times: dict[str, list[tuple[float, float]]] = {}
    for scene in scenes:
        megapixels = scene.mask.size / 1e6
        for name, measure in _timed_sensors(scene).items():
            wall, cpu = ms_side_by_side(measure, frames_at_once(), ROUNDS)
            times.setdefault(name, []).append((wall / megapixels, cpu / megapixels))
    means = {name: np.mean(rows, axis=0) for name, rows in times.items()}
    for name, (wall, cpu) in means.items():
        yield Result(
            {"sensor": name},
            {
                "time [ms/MP]": float(wall),
                "CPU [ms/MP]": float(cpu),
                "time / guided's": float(wall / means[SENSOR][0]),
                "CPU / guided's": float(cpu / means[SENSOR][1]),
            },
            "time",
        )


def _timed_sensors(scene: Scene) -> dict[str, Callable[[], object]]:
    """Return what is timed: the tiers as in a recording, and the full search without what follows it."""
    rig, images = scene.truth.rig, scene.images()
    left, right = map(gray_of, images)
    return {
        SENSOR: lambda: sense(scene.fresh(), "guided", recorded=images),
        YARDSTICK: lambda: sense(scene.fresh(), "matcher", recorded=images),
        SEARCH: lambda: match(left, right, search_range(rig), rig.window),
    }
