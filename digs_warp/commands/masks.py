"""`digs-warp masks assemble`: a network for object masks from the parts that it is distributed in."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from digs_warp.commands.command import Command
from digs_warp.commands.output import check_output_file

LICENSE = """Before you use it: may you? This program ships no weights and grants no right to any. The code of
isnet (xuebinqin/DIS) is under Apache-2.0; its authors say nothing of the weights, nor of the images that they
were trained with. Packages that distribute them have licenses of their own (AGPL-3 in one case). Ask whoever
you have the parts from."""


@dataclass(frozen=True, kw_only=True)
class Masks(Command):
    """Put the file of a mask network together from its parts, check it, and say what is known of its license.

    The parts are those that you have obtained; nothing is downloaded. The result is an ONNX file for --masks
    isnet and isnet+depth. A part that is named by its SHA-256 must have it.
    """

    action: Annotated[Literal["assemble"], tyro.conf.Positional]
    """What to do."""

    files: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="FILE")]
    """The parts in their order; or in any order, with the index of their package (.json) among them."""

    out: Path | None = None
    """The file to write. Default: where --masks isnet looks for it, isnet-general-use.onnx in ~/.u2net."""

    sha256: str | None = None
    """What the SHA-256 of the result has to be."""

    overwrite: tyro.conf.FlagCreatePairsOff[bool] = False
    """Replace the file if it exists."""

    def execute(self) -> str:
        """Assemble, and return what was written, what checked it, and the question of its license."""
        from digs_warp.masks.assemble import assemble
        from digs_warp.masks.network import default_model_path

        out = self.out or default_model_path()
        check_output_file(out, self.overwrite, self.files)
        found = assemble(self.files, out, self.sha256)
        checked = found.checked_by or "nothing: give --sha256 if you know what it should be"
        return (
            f"{out}: a mask network of {found.size / 1e6:.1f} MB\nSHA-256 {found.sha256}\n"
            f"checked by {checked}\n\n{LICENSE}"
        )
