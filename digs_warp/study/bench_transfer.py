"""`digs-warp bench transfer`: what is learned from simulated scenes, tried on real frames.

Two small tasks. Trees learn to find objects in depth, and are tried on ten real frames of an active camera
over a board. The parameters of semi-global matching are chosen on simulated pairs, and tried on Middlebury's
Motorcycle.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.images import read_image
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.sensor.filters import gray_of
from digs_warp.study.real_pair import read_pair
from digs_warp.study.results import Result
from digs_warp.study.scenes import SEE_SAMPLE_DATA, sample_data
from digs_warp.study.transfer.matching import KnownPair, MatcherSettings, tune, wrong_share
from digs_warp.study.transfer.recordings import KINDS, Kind, depth_frame, known_pair, scenes
from digs_warp.study.transfer.segmentation import (
    DepthFrame,
    above_plane,
    find_object,
    overlap,
    train,
)

SEEDS = (0, 1, 2)

# The nearest that we have to the real camera: active, and smoothed before its depth was stored.
ACTIVE = SimulateConfig(profile="d435", filters="spatial")
PASSIVE = SimulateConfig()

BOARD = "rgbd/primesense_single_object"
MOTORCYCLE = "rgbd/middlebury_motorcycle"

# Of the real frames: the part that shows board and object alone, units per metre, focal length [px].
ROWS, COLUMNS = slice(80, 345), slice(90, 560)
UNITS_PER_METRE, FOCAL = 10_000.0, 525.0


def bench_transfer(data: Path | None = None) -> list[Result]:
    """Return the scores on real frames by the scenes that were learned from.

    Args:
        data: folder of the sample data; None: DIGS_WARP_SAMPLE_DATA or ../shared/data.

    Raises:
        DigsError: the sample data is not there.
    """
    data = data or sample_data()
    for folder in (BOARD, MOTORCYCLE):
        if not (data / folder).is_dir():
            raise DigsError(
                f"bench transfer: '{data / folder}' is missing; this learns from the sample meshes and is "
                f"tried on real frames: {SEE_SAMPLE_DATA}"
            )
    return [*_segmentation(data), *_matching(data)]


def _segmentation(data: Path) -> Iterator[Result]:
    """Yield the overlap of found and true object, by what was learned from."""
    real = board_frames(data / BOARD)
    by_plane = [overlap(above_plane(frame), frame.is_object) for frame in real]
    for kind in KINDS:
        per_seed = []
        for seed in SEEDS:
            captures = scenes(data, kind, ACTIVE, seed)
            frames = [depth_frame(frame) for capture in captures for frame in capture.frames]
            trees = train(frames, seed)
            per_seed.append([overlap(find_object(trees, f), f.is_object) for f in real])
        yield _overlaps(kind, np.array(per_seed))
    yield _overlaps("nothing: above the most common plane", np.array([by_plane]))


def _overlaps(learned_from: str, overlaps: np.ndarray) -> Result:
    """Return the row of overlaps of shape (seeds, frames)."""
    means = overlaps.mean(axis=1)
    return Result(
        {"learned from": learned_from},
        {
            "IoU, mean": float(means.mean()),
            "lowest seed": float(means.min()),
            "highest seed": float(means.max()),
            "worst frame": float(overlaps.mean(axis=0).min()),
        },
        "objects",
    )


def _matching(data: Path) -> Iterator[Result]:
    """Yield what a matcher gets wrong on the real pair, by the pairs that its parameters were chosen on."""
    pair = read_pair(data / MOTORCYCLE)
    end = 16 * int(np.ceil((np.nanmax(pair.disparity) + 1) / 16))
    real = KnownPair(gray_of(pair.left), gray_of(pair.right), pair.disparity, end)
    chosen = {kind: _tuned(data, kind) for kind in KINDS}
    chosen |= {
        "nothing: OpenCV's suggestion": MatcherSettings(),
        "the real pair itself": tune([real]),
    }
    for learned_from, settings in chosen.items():
        yield Result(
            {"chosen on": learned_from, "block, P1, P2, uniqueness": str(settings)},
            {"wrong or open [%]": 100 * wrong_share(settings, real)},
            "matching",
        )


def _tuned(data: Path, kind: Kind) -> MatcherSettings:
    pairs = []
    for capture in scenes(data, kind, PASSIVE, SEEDS[0]):
        assert capture.rig is not None
        pairs += [known_pair(frame, capture.rig.baseline) for frame in capture.frames]
    return tune(pairs)


def board_frames(folder: Path) -> list[DepthFrame]:
    """Return the ten real frames, cut to the board."""
    frames = []
    for path in sorted(folder.glob("depth_*.png")):
        depth = read_image(path, what="depth")[ROWS, COLUMNS, 0].astype(np.float32)
        mask = read_image(path.with_name(path.name.replace("depth", "mask")), what="mask")
        depth = np.where(depth > 0, depth / UNITS_PER_METRE, np.nan)
        frames.append(DepthFrame(depth, FOCAL, mask[ROWS, COLUMNS, 0] > 0))
    return frames
