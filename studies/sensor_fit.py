"""`python -m studies sensor-fit`: walls with known figures are recorded and fitted."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from digs_warp.sim.camera.profiles import load_profile
from digs_warp.sim.fit.estimate import Estimate
from digs_warp.sim.fit.fit_wall import fit_wall
from digs_warp.sim.fit.result import text
from digs_warp.sim.fit.textured_wall import in_memory, record_wall
from digs_warp.sim.fit.wall import read_wall
from digs_warp.sim.sensor.drift import Drift
from digs_warp.study.engine.case import STUDIED_CAMERA
from studies.results import Result

# Of the walls: image size and frames at each of the five places.
SIZE, FRAMES = (480, 270), 5

# Figures of the walls by seed, and the drift of their cameras.
WALLS = {
    0: {"image_noise": 1.5, "full_well": 9_000.0, "static_field": 0.10},
    1: {"image_noise": 2.5, "full_well": 5_000.0, "static_field": 0.16},
    2: {"image_noise": 4.0, "full_well": 2_500.0, "static_field": 0.25},
}
RANGE = {"min_depth": 0.68, "max_depth": 2.55}
DRIFTS = {
    0: Drift(yaw_deg=0.03, roll_deg=0.02, focal=8e-4, baseline=8e-3),
    1: Drift(yaw_deg=-0.04, roll_deg=0.05, focal=-1e-3, baseline=-1e-2),
    2: Drift(yaw_deg=0.05, roll_deg=-0.06, focal=1.5e-3, baseline=1.5e-2),
}
LAW = {
    "disparity_sigma": 0.12,
    "disparity_step": 1 / 16,
    "disparity_correlation": 12.0,
    "temporal_share": 0.4,
}


def bench_sensor_fit() -> list[Result]:
    """Return known figures beside fitted ones."""
    return [*_walls(), *_law()]


def _walls() -> Iterator[Result]:
    base = load_profile(STUDIED_CAMERA).rig(*SIZE)
    for seed, figures in WALLS.items():
        drift = DRIFTS[seed]
        rig = replace(base, unit=seed, **RANGE, **figures)
        capture = record_wall(in_memory(rig), rig, "guided", frames=FRAMES, seed=seed, drift=drift)
        fit = fit_wall(read_wall(capture, rig.baseline), base)
        known = figures | RANGE | {
            "rotation_drift": float(np.sqrt((drift.yaw_deg**2 + drift.roll_deg**2) / 2)),
            "focal_drift": abs(drift.focal),
            "baseline_drift": abs(drift.baseline),
        }  # fmt: skip
        found = {figure.name: figure.estimate for figure in fit.figures}
        yield from (_row(seed, name, value, found.get(name)) for name, value in known.items())


def _law() -> Iterator[Result]:
    base = load_profile(STUDIED_CAMERA).rig(*SIZE)
    rig = replace(base, **LAW)
    fit = fit_wall(read_wall(record_wall(in_memory(rig), rig, "law", frames=FRAMES), 1.0), base)
    found = {figure.name: figure.estimate for figure in fit.figures}
    yield from (_row("0, law", name, value, found.get(name)) for name, value in LAW.items())


def _row(seed: int | str, name: str, value: float, found: Estimate | None) -> Result:
    labels = {"seed": seed, "figure": name, "fitted": text(found) if found else "not known"}
    values = {"known": value}
    if found is not None and np.isfinite(found.error):
        off = abs(found.value - value) / found.error if found.error else 0.0
        values["off by standard errors"] = off
    return Result(labels, values, "walls")
