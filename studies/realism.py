"""`python -m studies realism`: does the simulated sensor err where real matching errs, and in the same way?

The yardstick is the `matcher` tier on the same two images. The default sensor is compared with it on one
frame of every sample mesh (the built-in object where there is no sample data), at two image sizes. The
matcher under other image noise is a separate row. The environments take turns, so that texture and light
differ. Scenes that were kept aside when constants were chosen are a row of their own.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from digs_warp.record.progress import progress
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
    with progress(len(widths) * len(chosen), "Comparing", "frame") as bar:
        for width in widths:
            scenes, patches = [], {name: [] for name in (SENSOR, OTHER_NOISE, YARDSTICK)}
            for place in chosen:
                scene = place.scene(width)
                scenes.append(scene)
                sensed = _sensed(scene)
                results += _scene_results(scene, sensed, width)
                for name, disparity in sensed.items():
                    patches[name].append(patch_features(disparity - scene.truth.disparity))
                bar.update()
            for name in (SENSOR, OTHER_NOISE) if len(scenes) > 1 else ():
                classifiers[width, name] = auc_of_classifier(patches[name], patches[YARDSTICK])
            if width == widths[0]:
                results += _temporal_results(scenes)
    return [*_summary(results, classifiers, widths), *results]


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
