"""`digs-warp convert`: a capture folder -> another program's format."""

import os
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import tyro

from digs_warp.commands.layout import RUN_RECORD
from digs_warp.commands.output import OutputFolder
from digs_warp.log import RunLog


@dataclass(frozen=True, kw_only=True)
class Convert:
    """Write a capture in another program's format (nerfstudio reads the capture as it is)."""

    capture: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="CAPTURE")]
    """A capture folder: from 'digs-warp simulate', or your own recording."""

    to: Literal["colmap", "colmap-binary", "tum", "bop", "redwood"]
    """The format: COLMAP model (text or binary), TUM RGB-D, BOP, or Redwood for Open3D."""

    out: Path
    """Folder to write; it has to be new or empty, unless --overwrite is given."""

    overwrite: tyro.conf.FlagCreatePairsOff[bool] = False
    """Delete the results of an earlier run in this folder first."""

    can_resume: ClassVar[bool] = False

    def execute(self) -> str:
        """Export under a temporary name, then rename: the folder is complete or not there."""
        from digs_warp.capture import read_capture
        from digs_warp.interchange.export import export_capture

        output = OutputFolder(out=self.out, overwrite=self.overwrite)
        folder = output.prepare(inputs=[self.capture]).resolve()
        capture = read_capture(self.capture)
        log = RunLog("convert", {"capture": self.capture, "to": self.to})
        unfinished = folder.with_name(f".{folder.name}.{os.getpid()}.tmp")
        try:
            with log.stage("export"):
                export_capture(capture, self.to, unfinished)
            log.results = {"frames": len(capture)}
            log.save(unfinished / RUN_RECORD)
            os.replace(unfinished, folder)
        finally:
            shutil.rmtree(unfinished, ignore_errors=True)
        return f"{self.out}: {len(capture)} frames as {self.to}, {log.seconds['export']:.1f} s"
