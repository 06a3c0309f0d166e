"""`digs-warp info`: say what a file or folder holds."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from digs_warp.checks import DigsError
from digs_warp.commands.command import Command
from digs_warp.commands.facts import Facts, format_facts
from digs_warp.commands.output import is_ours
from digs_warp.data.capture import INDEX_NAME
from digs_warp.record import layout
from digs_warp.record.files import read_json


@dataclass(frozen=True, kw_only=True)
class Info(Command):
    """Say what a file or folder holds: a capture, a reconstruction, Gaussians, a USD scene, a mesh."""

    path: Annotated[Path, tyro.conf.Positional]
    """A folder that a command wrote, Gaussians (.npz, .ply, .spz, .splat), a USD file, or a mesh."""

    def execute(self) -> str:
        """Look and return the facts, one per line."""
        return format_facts(describe(self.path))


def describe(path: Path) -> Facts:
    """Return what is known about ``path``, in the order in which a reader wants it."""
    from digs_warp.commands import summaries

    if not path.exists():
        raise DigsError(f"'{path}': no such file or folder. Check the path.")
    if path.is_dir():
        return _summary_of_folder(path)(path)
    by_suffix: dict[str, Callable[[Path], Facts]] = {
        ".npz": summaries.of_gaussians,
        **dict.fromkeys((".usd", ".usda", ".usdc", ".usdz"), summaries.of_usd),
        **dict.fromkeys((".spz", ".splat"), summaries.of_splat_file),
        ".ply": summaries.of_ply,
        **dict.fromkeys((".glb", ".gltf", ".obj", ".stl"), summaries.of_mesh),
    }
    summary = by_suffix.get(path.suffix.lower())
    if summary is None:
        raise DigsError(
            f"'{path}': cannot tell what '{path.suffix}' is; one of {', '.join(by_suffix)}"
        )
    return summary(path)


def _summary_of_folder(path: Path) -> Callable[[Path], Facts]:
    from digs_warp.commands import summaries

    if (path / INDEX_NAME).is_file():
        return summaries.of_capture
    if (path / layout.GAUSSIANS).is_file():
        return summaries.of_reconstruction
    if (path / layout.CAPTURE).is_dir():
        return summaries.of_run
    if (path / layout.DATA_SET).is_file():
        return summaries.of_data_set
    if is_ours(path):
        command = read_json(path / layout.RUN_RECORD, "run record")["command"]
        raise DigsError(
            f"'{path}': 'digs-warp {command}' has not finished here; run it again with --resume"
        )
    raise DigsError(
        f"'{path}': holds neither a capture ({INDEX_NAME}) nor a reconstruction ({layout.GAUSSIANS}) "
        f"nor the results of 'digs-warp run' ({layout.CAPTURE}/)"
    )
