"""`python -m studies device`: figures of real depth cameras beside those of the simulated ones.

The same functions measure both (`digs_warp.sim.fit.device_figures`). The real sets are those of the sample
data; others' figures are in the tables below.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.data.images import read_image
from digs_warp.record.progress import progress
from digs_warp.sim.camera.profiles import load_profile
from digs_warp.sim.config import SimulateConfig, Tier
from digs_warp.sim.fit.device_figures import (
    WINDOWS,
    holes,
    roughness,
    temporal_share,
)
from digs_warp.sim.record.record import simulate_in_memory
from digs_warp.study.scenes import sample_data
from studies.boards_and_edges import edge, plane_error
from studies.device_scenes import MATERIALS, Still, board, both, photographed
from studies.results import Result

TIERS: tuple[Tier, ...] = ("guided", "law")
FRAMES = 6  # of a camera at rest

# Distances between which planes count, and their middle [m].
NEAR_1 = (0.7, 1.0)
NEAR_1_2 = (1.0, 1.4)

# Sets of the sample data, and focal length times baseline of their depth cameras [px m].
REAL = {"d435_planes": 383 * 0.05, "d4xx_lab_floor": 385 * 0.05}

# Profiles with figures to be set beside those of a room, and the widths of their images [px].
PROFILES = {"d435": 848, "d455": 848}

# github.com/ychen921/rgbd-characterization (2026), an Orbbec Gemini 33x. By distance [m]: size of the board
# in the image [px], deviation of a pixel and RMS distance from the plane [mm].
BOARDS = {
    0.5: ((250, 170), 0.44, 1.26),
    1.0: ((191, 161), 1.47, 3.69),
    1.5: ((141, 111), 2.77, 5.06),
    2.0: ((107, 91), 4.66, 9.07),
    3.0: ((62, 55), 11.55, 16.92),
}
# By distance of the edge, 0.3 m before a background: width [px], mixed, bleeding, missing.
EDGES = {
    0.5: (3.1, 0.006, 0.002, 0.010),
    1.0: (3.3, 0.066, 0.054, 0.028),
    2.0: (6.2, 0.176, 0.016, 0.0),
}
GAP = 0.3  # [m]
ALLOWED = 0.02  # of a value from its side, as a share of the distance
# RMS distance from the plane at 1 m [mm].
TILTS = {0: 6.1, 15: 5.2, 30: 5.2, 45: 4.2, 60: 4.6}
SURFACES = {"black": 4.35, "cardboard": 5.09, "reflective": 5.39, "transparent": 60.0}

# Others' figures of a D455 before a flat board, in px.
PUBLISHED = {"D455, flat board, measured": (0.031, 0.068, 0.113, 0.124)}


def bench_device(data: Path | None = None) -> list[Result]:
    """Return one row for each real or simulated camera and scene.

    Args:
        data: folder of the sample data; None: DIGS_WARP_SAMPLE_DATA or ../shared/data.
    """
    results = list(_real_sets(data or sample_data()))
    for name, values in PUBLISHED.items():
        results.append(_rough(name, "0.7 to 1.0", values))
    for profile, width in PROFILES.items():
        for tier in TIERS:
            results += _room(profile, width, tier)
    with progress(len(BOARDS) + len(EDGES) + len(TILTS) + len(SURFACES), "Boards", "board") as bar:
        for result in _boards():
            results.append(result)
            bar.update()
    return results


def _real_sets(data: Path) -> Iterator[Result]:
    for name, focal_baseline in REAL.items():
        paths = sorted((data / "rgbd" / name / "depth").glob("*.png"))
        if paths:
            depth = np.stack([read_image(path)[..., 0] for path in paths]).astype(np.float64) / 1000
            yield from _figures(f"real: {name}", np.where(depth > 0, depth, np.nan), focal_baseline)


def _room(profile: str, width: int, tier: Tier) -> Iterator[Result]:
    """Yield the figures of the built-in room."""
    config = SimulateConfig(profile=profile, width=width, frames=4, samples_per_pixel=2, tier=tier)
    capture = simulate_in_memory(config)
    depth = np.stack([frame.load_depth() for frame in capture.frames])
    known = np.where(np.isfinite(depth) & (depth > 0), depth, np.nan)
    yield from _figures(
        f"{profile}, {tier}", known, load_profile(profile).rig(width).focal_baseline
    )


def _figures(name: str, depth: np.ndarray, focal_baseline: float) -> Iterator[Result]:
    disparity = focal_baseline / depth
    found = {size: roughness(disparity, size) for size in WINDOWS}
    for low, high in (NEAR_1, NEAR_1_2):
        medians = [
            each.median(focal_baseline / high, focal_baseline / low) for each in found.values()
        ]
        yield _rough(name, f"{low} to {high}", medians)
    each = [holes(frame) for frame in disparity]
    yield _result(
        {"camera": name},
        {
            "share of the pixels": float(np.mean([one.share for one in each])),
            "in 10,000 px": float(np.mean([one.per_10000 for one in each])),
            "of the area, in up to 3 px": float(np.mean([one.small for one in each])),
        },
        "holes",
    )


def _rough(name: str, distance: str, values: Sequence[float]) -> Result:
    medians = {f"{size} px": value for size, value in zip(WINDOWS, values, strict=True)}
    return _result({"camera": name, "distance [m]": distance}, medians, "roughness")


def _result(labels: dict[str, Any], values: Mapping[str, float], table: str) -> Result:
    """Return a row without the values that are not known."""
    known = {name: float(value) for name, value in values.items() if np.isfinite(value)}
    return Result(labels, known, table)


def _boards(profile: str = "gemini-335") -> Iterator[Result]:
    """Yield the figures of boards before the camera that they were published for."""
    for distance, (size, temporal, rmse) in BOARDS.items():
        still = photographed(board(distance), profile)
        values = {"real: share that changes": (temporal / rmse) ** 2, "real: RMSE [mm]": rmse}
        for tier in TIERS:
            values |= _on_board(still, tier, size)
        yield _result({"distance [m]": distance}, values, "boards")
    for distance, real in EDGES.items():
        near, far = board(distance, right=0.0), board(distance + GAP)
        still = photographed(both(near, far), profile)
        values = dict(zip(_EDGE, real, strict=True))
        values |= _on_edge(still, "guided", distance)  # those of "law" are perfect
        yield _result({"distance [m]": distance}, values, "edges")
    others = {
        f"tilted by {tilt}": (board(1.0, tilt_deg=tilt), rmse) for tilt, rmse in TILTS.items()
    }
    others |= {name: (board(1.0, MATERIALS[name]), rmse) for name, rmse in SURFACES.items()}
    # Nobody says what stood behind.
    others["transparent"] = (
        both(others["transparent"][0], board(1.0 + GAP)),
        SURFACES["transparent"],
    )
    for name, (scene, rmse) in others.items():
        still = photographed(scene, profile)
        found = _on_board(still, "guided", BOARDS[1.0][0])["guided: RMSE [mm]"]
        values = {"real: RMSE [mm]": rmse, "guided: RMSE [mm]": found}
        yield _result({"board at 1 m": name}, values, "surfaces")


_EDGE: tuple[str, ...] = ("real: width [px]", "real: mixed", "real: bleeding", "real: missing")


def _on_board(still: Still, tier: Tier, size: tuple[int, int]) -> dict[str, float]:
    height, width = still.truth.depth.shape
    rows, columns = (
        slice(middle - part // 2, middle - part // 2 + part)
        for middle, part in ((height // 2, size[1]), (width // 2, size[0]))
    )
    depth = np.stack([each[rows, columns] for each in still.depths(tier, FRAMES)])
    error = depth - still.truth.depth[rows, columns]
    share = temporal_share(error - np.nanmean(error))  # the source measures from the plane, too
    rmse = np.median([plane_error(each, still.rig.intrinsics.fx)[0] for each in depth])
    return {f"{tier}: share that changes": share, f"{tier}: RMSE [mm]": 1000 * float(rmse)}


def _on_edge(still: Still, tier: Tier, near: float) -> dict[str, float]:
    """The near board fills the left half of the image."""
    height, width = still.truth.depth.shape
    place = np.broadcast_to(np.arange(width) + 0.5 - width / 2, (height, width))
    found = [
        edge(depth, place, near, near + GAP, ALLOWED * near) for depth in still.depths(tier, FRAMES)
    ]
    values = {
        "width [px]": np.median([each.width for each in found]),
        "mixed": np.mean([each.mixed for each in found]),
        "bleeding": np.mean([each.bleeding for each in found]),
        "missing": np.mean([each.missing for each in found]),
    }
    return {f"{tier}: {key}": float(value) for key, value in values.items()}
