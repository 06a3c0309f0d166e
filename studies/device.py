"""`python -m studies device`: figures of real depth cameras beside those of the simulated ones.

The same functions measure both (`digs_warp.sim.fit.device_figures`). The real sets are those of the sample
data; others' figures are in the tables below.
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
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
)
from digs_warp.sim.record.record import simulate_in_memory
from digs_warp.sim.sensor.law import sense_depth
from digs_warp.study.scenes import sample_data
from studies.boards_and_edges import edge, plane_error
from studies.device_scenes import MATERIALS, WHITE, Still, board, both, photographed
from studies.results import Result

TIERS: tuple[Tier, ...] = ("guided", "law")
FRAMES = 4  # of a camera at rest

# Distances between which planes count, and their middle [m].
NEAR_1 = (0.7, 1.0)
NEAR_1_2 = (1.0, 1.4)

# Sets of the sample data, and focal length times baseline of their depth cameras [px m].
REAL = {"d435_planes": 383 * 0.05, "d4xx_lab_floor": 385 * 0.05}

# Profiles with figures to be set beside those of a room, and the widths of their images [px].
PROFILES = {"d435": 848, "d455": 848}

# github.com/ychen921/rgbd-characterization (2026), an Orbbec Gemini 33x. By distance [m]: size of the board
# in the image [px], by how much it is turned [degree], deviation of a pixel and RMS distance from the plane
# [mm].
BOARDS = {
    0.5: ((250, 170), 2.45, 0.44, 1.26),
    1.0: ((191, 161), 3.05, 1.47, 3.69),
    1.5: ((141, 111), 2.06, 2.77, 5.06),
    2.0: ((107, 91), 1.91, 4.66, 9.07),
    3.0: ((62, 55), 3.43, 11.55, 16.92),
}
# By distance of the edge, 0.3 m before a background: places that count [px], width [px], mixed, missing.
EDGES = {
    0.5: (20, 3.1, 0.006, 0.010),
    1.0: (20, 3.3, 0.066, 0.028),
    2.0: (12, 6.2, 0.176, 0.0),
}
GAP = 0.3  # [m]

# Errors of matching depend on the fraction of a pixel, which nobody has published: medians over boards
# nearer and farther by these factors, turned to either side.
PLACES = (0.96, 0.98, 1.0, 1.02, 1.04)
# At 1 m: by how much the board is turned [degree], RMS distance from the plane [mm].
SURFACES = {
    "tilted by 0": (3.4, 6.1),
    "tilted by 15": (17.7, 5.2),
    "tilted by 30": (21.1, 5.2),
    "tilted by 45": (28.4, 4.2),
    "tilted by 60": (56.6, 4.6),
    "black": (4.6, 4.35),
    "cardboard": (3.7, 5.09),
    "reflective": (7.3, 5.39),
    "transparent": (0.0, 60.0),  # the plane of its values is turned by 70
}

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
        results += _walls(profile)
    with progress(len(BOARDS) + len(EDGES) + len(SURFACES), "Boards", "board") as bar:
        for result in _boards():
            results.append(result)
            bar.update()
    return [*results, *_how_far_off(results)]


# What the simulated cameras are to look like; the Gemini's boards have both in one row.
FITTED = {"d435": "real: d435_planes", "d455": "D455, flat board, measured"}


def _how_far_off(results: Sequence[Result]) -> Iterator[Result]:
    """Yield by what factor the figures of each profile are off at most; shares that change by how much."""
    rows = {(row.table, *row.labels.values()): row.values for row in results}
    for profile in (*FITTED, "gemini-335"):
        for tier in TIERS:
            off: dict[str, list[float]] = defaultdict(list)
            for (table, camera, *place), found in rows.items():
                if camera == f"{profile}, {tier}":
                    real = rows.get((table, FITTED[profile], *place), {})
                    for name in found.keys() & real.keys():
                        off["planes" if table == "roughness" else table].append(
                            _factor(found[name], real[name])
                        )
                elif profile not in FITTED and table in ("boards", "edges"):
                    for name, column in _COLUMNS.items():
                        if f"{tier}: {name}" in found:
                            pair = found[f"{tier}: {name}"], found[f"real: {name}"]
                            is_share = column == "change"
                            off[column].append(
                                abs(pair[0] - pair[1]) if is_share else _factor(*pair)
                            )
            most = {name: max(values) for name, values in off.items()}
            yield _result({"profile, tier": f"{profile}, {tier}"}, most, "profiles")


_COLUMNS = {
    "RMSE [mm]": "planes",
    "share that changes": "change",
    "width [px]": "width of edges",
    "mixed": "mixed at edges",
}


def _factor(found: float, real: float) -> float:
    """Return by what factor two positive numbers differ."""
    return max(found / real, real / found) if min(found, real) > 0 else np.inf


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


def _walls(profile: str) -> Iterator[Result]:
    """Yield how rough "law" is on walls without holes: in windows of 64 px there is always one."""
    rig = load_profile(profile).rig()
    shape = rig.intrinsics.height, rig.intrinsics.width
    for low, high in (NEAR_1, NEAR_1_2):
        wall = np.full(shape, (low + high) / 2, np.float32)
        disparity = rig.focal_baseline / sense_depth(wall, rig, 0, 0)
        medians = [roughness(disparity, size).median() for size in WINDOWS]
        yield _rough(f"{profile}, law", f"{low} to {high}", medians)


def _figures(name: str, depth: np.ndarray, focal_baseline: float) -> Iterator[Result]:
    disparity = focal_baseline / depth
    found = {size: roughness(disparity, size) for size in WINDOWS}
    for low, high in () if name.endswith("law") else (NEAR_1, NEAR_1_2):
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
    for distance, (_, _, temporal, rmse) in BOARDS.items():
        values = {"real: share that changes": (temporal / rmse) ** 2, "real: RMSE [mm]": rmse}
        yield _result(
            {"distance [m]": distance}, values | board_figures(distance, profile), "boards"
        )
    for distance, (_, *real) in EDGES.items():
        values = dict(zip(("real: width [px]", "real: mixed", "real: missing"), real, strict=True))
        values |= edge_figures(distance, profile)
        yield _result({"distance [m]": distance}, values, "edges")
    for name, (turned, rmse) in SURFACES.items():
        material = MATERIALS.get(name, WHITE)
        scenes = [board(place, material, turned) for place in PLACES]
        if material.is_transparent:  # nobody says what stood behind
            scenes = [
                both(each, board(place + GAP)) for each, place in zip(scenes, PLACES, strict=True)
            ]
        found = _medians(
            _on_board(photographed(each, profile), "guided", BOARDS[1.0][0]) for each in scenes
        )
        values = {"real: RMSE [mm]": rmse, "guided: RMSE [mm]": found["guided: RMSE [mm]"]}
        yield _result({"board at 1 m": name}, values, "surfaces")


def board_figures(
    distance: float, profile: str = "gemini-335", tiers: Sequence[Tier] = TIERS
) -> dict[str, float]:
    """Return what cameras at rest find on white boards at a distance of `BOARDS`, medians over `PLACES`."""
    size, turned, *_ = BOARDS[distance]

    def each() -> Iterator[dict[str, float]]:
        for number, place in enumerate(PLACES):
            scene = board(place * distance, tilt_deg=turned * (-1) ** number)
            still = photographed(scene, profile)
            yield {k: v for tier in tiers for k, v in _on_board(still, tier, size).items()}

    return _medians(each())


def edge_figures(distance: float, profile: str = "gemini-335") -> dict[str, float]:
    """Return what "guided" finds at edges at a distance of `EDGES`, medians; those of "law" are perfect."""
    scenes = [
        both(board(place * distance, right=0.0), board(place * distance + GAP)) for place in PLACES
    ]
    return _medians(_on_edge(photographed(each, profile), EDGES[distance][0]) for each in scenes)


def _medians(found: Iterable[dict[str, float]]) -> dict[str, float]:
    rows = list(found)
    return {name: float(np.nanmedian([row[name] for row in rows])) for name in rows[0]}


def _on_board(still: Still, tier: Tier, size: tuple[int, int]) -> dict[str, float]:
    height, width = still.truth.depth.shape
    rows, columns = (
        slice(middle - part // 2, middle - part // 2 + part)
        for middle, part in ((height // 2, size[1]), (width // 2, size[0]))
    )
    depth = np.stack([each[rows, columns] for each in still.depths(tier, FRAMES)])
    changing = float(np.nanmean(depth.var(axis=0, ddof=1)))
    rmse = float(np.median([plane_error(each, still.rig.intrinsics.fx)[0] for each in depth]))
    return {f"{tier}: share that changes": changing / rmse**2, f"{tier}: RMSE [mm]": 1000 * rmse}


def _on_edge(still: Still, reach: float) -> dict[str, float]:
    """The near board fills the left half of the image."""
    height, width = still.truth.depth.shape
    place = np.broadcast_to(np.arange(width) + 0.5 - width / 2, (height, width))
    found = [edge(depth, place, reach) for depth in still.depths("guided", FRAMES)]
    return {
        "guided: width [px]": float(np.nanmedian([each.width for each in found])),
        "guided: mixed": float(np.mean([each.mixed for each in found])),
        "guided: missing": float(np.mean([each.missing for each in found])),
    }
