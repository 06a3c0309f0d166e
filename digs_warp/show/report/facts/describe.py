"""Finds out what a file or folder is, and returns the facts about it."""

from collections.abc import Callable
from pathlib import Path

from digs_warp.checks import DigsError
from digs_warp.data.index_rules import INDEX_NAME
from digs_warp.engines.task import RESULTS
from digs_warp.record import layout
from digs_warp.record.run_log import RunRecord
from digs_warp.show.report.facts.captures import of_capture, of_data_set
from digs_warp.show.report.facts.results import (
    of_gaussians,
    of_many_results,
    of_reconstruction,
    of_run,
    of_splat_file,
)
from digs_warp.show.report.facts.scene_files import of_mesh, of_usd
from digs_warp.show.report.facts.words import Facts


def describe(path: Path) -> Facts:
    """Return the facts about ``path``, the most important first."""
    if not path.exists():
        raise DigsError(f"'{path}': no such file or folder. Check the path.")
    if path.is_dir():
        return _summary_of_folder(path)(path)
    by_suffix: dict[str, Callable[[Path], Facts]] = {
        ".npz": of_gaussians,
        **dict.fromkeys((".usd", ".usda", ".usdc", ".usdz"), of_usd),
        **dict.fromkeys((".spz", ".splat"), of_splat_file),
        ".ply": of_ply,
        **dict.fromkeys((".glb", ".gltf", ".obj", ".stl"), of_mesh),
    }
    summary = by_suffix.get(path.suffix.lower())
    if summary is None:
        raise DigsError(
            f"'{path}': cannot tell what '{path.suffix}' is; one of {', '.join(by_suffix)}"
        )
    return summary(path)


def _summary_of_folder(path: Path) -> Callable[[Path], Facts]:
    if (path / INDEX_NAME).is_file():
        return of_capture
    if (path / layout.GAUSSIANS).is_file():
        return of_reconstruction
    if (path / layout.CAPTURE).is_dir():
        return of_run
    if (path / layout.DATA_SET).is_file():
        return of_data_set
    if (path / RESULTS).is_file():
        return of_many_results
    if (record := RunRecord.find(path)) is not None:
        raise DigsError(
            f"'{path}': 'digs-warp {record.command}' has not finished here; run it again with --resume"
        )
    raise DigsError(
        f"'{path}': holds neither a capture ({INDEX_NAME}) nor a reconstruction ({layout.GAUSSIANS}) "
        f"nor the results of 'digs-warp run' ({layout.CAPTURE}/)"
    )


def of_ply(path: Path) -> Facts:
    """Gaussians or a mesh: a PLY file can contain either."""
    from digs_warp.formats.splats.ply import holds_gaussians

    return of_splat_file(path) if holds_gaussians(path) else of_mesh(path)
