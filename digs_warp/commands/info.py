"""`digs-warp info`: say what a file or folder holds."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from digs_warp.commands.command import Command
from digs_warp.words import format_facts


@dataclass(frozen=True, kw_only=True)
class Info(Command):
    """Say what a file or folder holds: a capture, a reconstruction, Gaussians, a USD scene, a mesh."""

    path: Annotated[Path, tyro.conf.Positional]
    """A folder that a command wrote, Gaussians (.npz, .ply, .spz, .splat), a USD file, or a mesh."""

    prim: str | None = None
    """Path of the splats in a USD scene that shows several fields of them, such as /Asset/Gaussians."""

    def execute(self) -> str:
        """Look and return the facts, one per line."""
        from digs_warp.show.report.facts import describe, of_usd

        facts = describe(self.path) if self.prim is None else of_usd(self.path, self.prim)
        return format_facts(facts)
