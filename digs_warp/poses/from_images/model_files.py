"""A sparse model on disk, as COLMAP's binary files: complete, or not there."""

import shutil
from pathlib import Path
from typing import Any

from digs_warp.device.libraries import import_pycolmap
from digs_warp.record.disk import out_of_space, reported, temporary_beside
from digs_warp.record.files import copy_file, remove_folder

FILES = ("cameras.bin", "frames.bin", "images.bin", "points3D.bin", "rigs.bin")

# Bytes in COLMAP's binary files: a count before the points, a point without its track, a place in a track.
_COUNT, _POINT, _IN_TRACK = 8, 51, 8


def write_model(model: Any, folder: Path) -> None:
    """Write a `pycolmap.Reconstruction` into a folder, in place of an older model.

    COLMAP reports success for truncated files, so what it wrote is read back.

    Raises:
        DigsError: the disk is full.
    """
    unfinished = temporary_beside(folder)
    try:
        with reported(folder):
            unfinished.mkdir(parents=True, exist_ok=True)
        model.write(unfinished)
        if not _is_whole(model, unfinished):
            size = _COUNT + _POINT * model.num_points3D()
            raise out_of_space(folder, "COLMAP's files are not complete", size)
        remove_folder(folder)
        for name in FILES:
            copy_file(unfinished / name, folder / name)
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)


def is_complete(folder: Path) -> bool:
    """Whether all files of a model are there."""
    return all((folder / name).is_file() for name in FILES)


def _is_whole(model: Any, folder: Path) -> bool:
    points = _COUNT + _POINT * model.num_points3D() + _IN_TRACK * model.compute_num_observations()
    if not is_complete(folder) or (folder / "points3D.bin").stat().st_size != points:
        return False
    try:
        return _counts(import_pycolmap().Reconstruction(folder)) == _counts(model)
    except (IndexError, RuntimeError, ValueError):  # what COLMAP says of broken files
        return False


def _counts(model: Any) -> tuple[int, ...]:
    return (
        model.num_cameras(), model.num_rigs(), model.num_frames(), model.num_reg_frames(),
        model.num_images(), model.num_points3D(), model.compute_num_observations(),
    )  # fmt: skip
