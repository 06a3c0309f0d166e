"""The scene of several mesh files: each in its size and at rest, together on the ground or in a pile."""

import logging
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.sim.record.cluster import arrange, plan_of
from digs_warp.sim.scene.drop import dropped
from digs_warp.sim.scene.join import join_scenes
from digs_warp.sim.scene.load import MeshFile, read_mesh
from digs_warp.sim.scene.scene import MOST_OBJECTS, Scene

_log = logging.getLogger(__name__)

# Identifies the arrangement in the seeds.
ARRANGEMENT = 201

# Of objects whose sizes differ more, the small ones have few pixels: probably a wrong unit.
ODD_RATIO = 20.0


def load_objects(
    paths: Sequence[Path],
    seed: int,
    size: float | None = None,
    up: str = "auto",
    unit: str = "auto",
    falling: bool = False,
) -> Scene:
    """Return a scene of several mesh files, numbered in their order; its box is centered on the origin.

    Args:
        paths: of the files; one may be named several times.
        seed: of the arrangement.
        size: longest side of the longest object [m]: the others keep their proportion to it; None: those of
            the files.
        up: for every file; see `digs_warp.sim.scene.load.load_scene`.
        unit: likewise.
        falling: whether they fall in a pile, instead of standing beside each other.

    Raises:
        DigsError: a file that cannot be used, or too many; see also `digs_warp.sim.scene.drop.dropped`.
    """
    if len(paths) > MOST_OBJECTS:
        raise DigsError(f"--scene: {len(paths)} files, expected at most {MOST_OBJECTS}")
    read = {path: read_mesh(path, None, up, unit) for path in dict.fromkeys(paths)}
    longest = max(each.longest_side for each in read.values())
    if size is not None:
        read = {
            path: each.with_size(each.longest_side * size / longest) for path, each in read.items()
        }
    else:
        _check_ratio(list(read.values()))
    files = [read[path] for path in paths]
    rng = np.random.default_rng([seed, ARRANGEMENT])
    motions = dropped(files, rng) if falling else beside_each_other(files, rng)
    centered = _centering(files, motions)
    return join_scenes(
        *(each.scene(centered @ motion) for each, motion in zip(files, motions, strict=True))
    )


def beside_each_other(files: Sequence[MeshFile], rng: np.random.Generator) -> list[np.ndarray]:
    """Return the motion of each object to its place on the ground z = 0, (4, 4), in its own pose of rest."""
    spots = arrange([plan_of(each.vertices) for each in files], rng)
    motions = [spot.world_from_own for spot in spots]
    for each, motion in zip(files, motions, strict=True):
        motion[2, 3] = -each.vertices[:, 2].min()
    return motions


def _centering(files: Sequence[MeshFile], motions: Sequence[np.ndarray]) -> np.ndarray:
    """Return the shift of the box of all objects to the origin, (4, 4)."""
    points = [
        each.vertices @ motion[:3, :3].T + motion[:3, 3]
        for each, motion in zip(files, motions, strict=True)
    ]
    low = np.min([part.min(axis=0) for part in points], axis=0)
    high = np.max([part.max(axis=0) for part in points], axis=0)
    shift = np.eye(4)
    shift[:3, 3] = -(low + high) / 2
    return shift


def _check_ratio(files: list[MeshFile]) -> None:
    """Warn of objects whose sizes do not fit together."""
    largest = max(files, key=lambda each: each.longest_side)
    smallest = min(files, key=lambda each: each.longest_side)
    if largest.longest_side > ODD_RATIO * smallest.longest_side:
        _log.warning(
            "'%s' is %.3g m long beside '%s' of %.3g m: the smaller ones have few pixels. Is the unit of "
            "both files right? Scale one of them in a modelling program, or leave one out",
            *(largest.path.name, largest.longest_side),
            *(smallest.path.name, smallest.longest_side),
        )
