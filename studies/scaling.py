"""The laws of `python -m studies raster`: how a view grows with pixels, splats, overlap and threads.

One of the four varies at a time, the others stay. A law is fitted to all points of one thread together,

    raster [ns] = p pixels + q pairs + e evaluated pixels
    per splat [ns] = s splats + r pairs

where pairs are (tile, splat) and an evaluated pixel is one pixel under one splat. The first line is the
rasterizer forward and backward, the second projection, binning and their gradient.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from digs_warp.device.threads import default_threads
from digs_warp.record.progress import progress
from digs_warp.splat.device import DeviceGaussians
from digs_warp.study.charts import Chart, Curve
from studies.raster import RasterScene, count_work, stage_times
from studies.results import Result

REPEATS = 5
RASTER_STAGES = ("forward", "backward")
BASE = RasterScene("base", 640, 360, 20_000, lambda rng, n: rng.uniform(1.0, 4.0, (n, 2)))

# The time on one thread is a sum of these counts, each with its cost.
LAWS = {"raster": ("pixels", "pairs", "evaluated"), "per splat": ("splats", "pairs")}
CURVES = {
    "pixels": "pixels of the image (splats grow with it)",
    "splats": "splats",
    "overlap": "overlap: relative size of the splats",
    "threads": "threads",
}


@dataclass(frozen=True)
class Case:
    """One point of one curve."""

    curve: str
    at: float  # what the curve is drawn over
    scene: RasterScene
    threads: int = 1
    spread: float = 1.0  # factor on the radii of the splats


def cases() -> list[Case]:
    """Return the points of all curves."""
    sizes = ((320, 180), (640, 360), (960, 540), (1280, 720))
    pixels = [
        Case("pixels", w * h, replace(BASE, width=w, height=h), spread=w / BASE.width)
        for w, h in sizes
    ]
    splats = [Case("splats", n, replace(BASE, splats=n)) for n in (5_000, 10_000, 40_000, 80_000)]
    overlap = [Case("overlap", f, BASE, spread=f) for f in (0.5, 1.5, 2.0, 3.0)]
    cores = sorted({1, 2, default_threads()})
    threads = [Case("threads", n, replace(BASE, splats=80_000), threads=n) for n in cores]
    return [*pixels, *splats, *overlap, *threads]


def bench_scaling(repeats: int = REPEATS) -> list[Result]:
    """Return the times of all cases and the fitted laws."""
    todo = cases()
    results = []
    with progress(len(todo), "Measuring", "case") as bar:
        for case in todo:
            results.append(measure(case, repeats))
            bar.update()
    results += fit_laws([point for point in results if point.labels["threads"] == 1])
    return results


def measure(case: Case, repeats: int = REPEATS) -> Result:
    """Return the times of a view of the scene and of its gradient, with all counts of the laws as labels."""
    scene = case.scene
    gaussians = scene.gaussians()
    wide = replace(gaussians, log_scales=gaussians.log_scales + np.log(case.spread))
    times, renderer = stage_times(scene, DeviceGaussians.from_numpy(wide), case.threads, repeats)
    raster = sum(times[name] for name in RASTER_STAGES)
    labels = {
        "curve": case.curve,
        "at": case.at,
        "threads": case.threads,
        "pixels": scene.width * scene.height,
        "splats": scene.splats,
        "pairs": renderer.binner.total_pairs,
        "evaluated": count_work(renderer).pixels,
    }
    values = {"raster [ms]": raster, "per splat [ms]": sum(times.values()) - raster}
    return Result(labels, values, "points")


def fit_laws(points: Sequence[Result]) -> list[Result]:
    """Return the costs of the laws of the module [ns], none below zero, and their errors.

    The relative error is minimized: small scenes count as much as large ones.
    """
    results = []
    for law, terms in LAWS.items():
        times = 1e6 * np.array([point.values[f"{law} [ms]"] for point in points])
        counts = np.array([[point.labels[term] for term in terms] for point in points], float)
        costs, misses = fit_nonnegative(counts, times)
        values = {f"per {term} [ns]": float(c) for term, c in zip(terms, costs, strict=True)}
        values["median error [%]"] = float(np.median(100 * misses))
        values["largest [%]"] = float(100 * misses.max())
        results.append(Result({"law": law}, values, "laws"))
    return results


def fit_nonnegative(counts: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Fit values as a sum of counts times costs, none below zero, with the smallest relative error.

    Args:
        counts: shape (measurements, terms).
        values: what was measured, above 0, shape (measurements,).

    Returns:
        The cost of each term, and the relative error of each measurement.
    """
    from scipy.optimize import nnls

    # Columns of one size: counts of pixels and of frames differ by a factor of millions.
    relative = counts / values[:, None]
    size = np.linalg.norm(relative, axis=0)
    found, _ = nnls(relative / size, np.ones(len(values)))
    costs = found / size
    return costs, np.abs(counts @ costs / values - 1)


def scaling_charts(results: Sequence[Result]) -> list[Chart]:
    """Return a chart per curve: the measurements as points, the laws as lines."""
    points = [result for result in results if result.table == "points"]
    laws = {r.labels["law"]: r.values for r in results if r.table == "laws"}
    charts = []
    for curve, x_label in CURVES.items():
        of_curve = [r for r in points if r.labels["curve"] == curve]
        of_curve.sort(key=lambda r: r.labels["at"])
        at = [r.labels["at"] for r in of_curve]
        curves = []
        for color, (law, costs) in enumerate(laws.items()):
            measured = [r.values[f"{law} [ms]"] for r in of_curve]
            expected = [
                sum(costs[f"per {term} [ns]"] * r.labels[term] for term in LAWS[law])
                / (1e6 * r.labels["threads"])
                for r in of_curve
            ]
            curves.append(Curve(law, at, measured, line=False, color=color))
            curves.append(Curve(f"{law}, law", at, expected, marker=False, color=color))
        y_label = "forward and backward [ms]"
        if at:
            title = f"Time by {curve}"
            charts.append(Chart(f"scaling_{curve}", title, curves, x_label, y_label, True, True))
    return charts
