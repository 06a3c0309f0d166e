"""Reads Gaussians or a posed recording from a file or folder; writes Gaussians to any supported file."""

import logging
from dataclasses import replace
from pathlib import Path

import numpy as np

from digs_warp.checks import DigsError, require_file
from digs_warp.data.capture import Capture, read_capture
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.index_rules import INDEX_NAME
from digs_warp.formats.splats.files import (
    AS_IT_IS,
    SplatWriting,
    UpAxis,
    read_splat_file,
    suffix_of,
    write_splat_file,
)
from digs_warp.formats.splats.files import SUFFIXES as SPLAT_SUFFIXES
from digs_warp.formats.splats.files import WRITABLE as SPLATS_WRITABLE
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.record.layout import GAUSSIANS, find_gaussians

logger = logging.getLogger(__name__)

OURS = ".npz"
USD_SUFFIXES = (".usdz", ".usdc", ".usda", ".usd")
SUFFIXES = (OURS, *SPLAT_SUFFIXES, *USD_SUFFIXES)
WRITABLE = (OURS, *SPLATS_WRITABLE, *USD_SUFFIXES)

# Points that go with photographs into other programs, at most.
MOST_POINTS = 50_000


def read_scene(
    source: Path,
    up: UpAxis = "z",
    drop_broken: bool = False,
    capture: Capture | None = None,
    prim: str | None = None,
) -> Reconstruction:
    """Return the Gaussians of a file or folder, with all that is known about their origin.

    Args:
        source: a folder of 'digs-warp reconstruct' or 'run', an ``.npz``, a splat file or a USD scene.
        up: the axis that points up in PLY, SOG and .splat files, which do not say it.
        drop_broken: drop a splat file's Gaussians with NaN or infinite values instead of rejecting the file.
        capture: the recording; default: the one that a run left in or beside the folder, if any.
        prim: path of the splats in a USD scene that shows several fields of them.

    Raises:
        DigsError: the source is missing, damaged or none of these.
    """
    path = find_gaussians(Path(source))
    if path.name == GAUSSIANS:
        return Reconstruction.load(path, capture, partial=True)
    gaussians = _read_gaussians(path, up, drop_broken, prim)
    for sentence in gaussians.doubts:
        logger.warning("'%s': %s", path, sentence)
    return Reconstruction.of_gaussians(gaussians, path.parent, capture)


def posed_capture(folder: Path) -> Capture:
    """Return the capture in ``folder``; if that holds a reconstruction, its capture with its frames.

    Frames that the reconstruction could not place are left out. Sparse points are those that photographs
    were started from: those of the recording belong to the poses that it had.

    Raises:
        DigsError: neither is there, a file is broken, or the recording of a reconstruction is gone.
    """
    if not _is_reconstruction(folder):
        return read_capture(folder)
    result = Reconstruction.load(folder)
    if result.frames is None or result.capture is None:
        raise DigsError(
            f"reconstruction '{folder}': found no capture that it was made from; put one beside it, named "
            "'capture'"
        )
    capture = read_capture(result.capture)
    frames = tuple(frame for frame, _ in result.frames.by_time)
    offset = result.poses.world_offset
    about = replace(capture.about, poses_known=None, world_offset=offset)
    held_out = frozenset(frame.name for frame in result.frames.held_out)
    points = result.start.points if result.start and not capture.has_depth else None
    if points is not None and len(points) > MOST_POINTS:
        points = points.select(np.linspace(0, len(points) - 1, MOST_POINTS).astype(int))
    return replace(capture, frames=frames, about=about, points=points, held_out=held_out)


def _is_reconstruction(folder: Path) -> bool:
    if not folder.is_dir() or (folder / INDEX_NAME).is_file():
        return False
    try:
        find_gaussians(folder)
    except DigsError:
        return False
    return True


def check_target(target: Path) -> None:
    """Raise a `DigsError` unless the suffix of ``target`` is one that `write_scene_file` knows."""
    if suffix_of(target) not in WRITABLE:
        raise DigsError(
            f"'{target}': suffix '{target.suffix}', expected one of {', '.join(WRITABLE)} for Gaussians"
        )


def save_file(path: Path, result: Reconstruction | Gaussians) -> None:
    """Write a reconstruction, or Gaussians of no known origin, into a file of any format."""
    check_target(path)
    if isinstance(result, Gaussians):
        result = Reconstruction(gaussians=result)
    write_scene_file(path, result, result.folder or Path("memory"))


def write_scene_file(
    target: Path,
    result: Reconstruction,
    source: Path,
    how: SplatWriting = AS_IT_IS,
) -> None:
    """Write Gaussians in the format that the suffix of ``target`` names.

    A USD scene says how a reconstruction was made; for other Gaussians, it has the name of their ``source``.
    ``how`` is for the formats of other programs.
    """
    suffix = suffix_of(target)
    gaussians = result.gaussians
    if gaussians.world_offset is None:
        gaussians = replace(gaussians, world_offset=result.poses.world_offset)
    if suffix in SPLAT_SUFFIXES:
        write_splat_file(target, gaussians, how)
    elif suffix not in USD_SUFFIXES:
        gaussians.save(target)
    else:
        from digs_warp.usd.writer import write_gaussians

        metadata = result.scene_metadata if result.folder else {"source": source.name}
        write_gaussians(target, gaussians, metadata)


def _read_gaussians(path: Path, up: UpAxis, drop_broken: bool, prim: str | None) -> Gaussians:
    suffix = suffix_of(path)
    if suffix in SPLAT_SUFFIXES:
        return read_splat_file(path, up, drop_broken)
    if suffix in USD_SUFFIXES:
        from digs_warp.usd.reader import read_gaussians

        return read_gaussians(path, prim)
    require_file(path, "Gaussians")
    if suffix != OURS:
        raise DigsError(
            f"'{path}': suffix '{path.suffix}', expected Gaussians: a folder of 'digs-warp reconstruct', "
            f"or one of {', '.join(SUFFIXES)}; SuperSplat and splat-transform make PLY of other formats"
        )
    return Gaussians.load(path)
