"""`digs-warp report`: a stored reconstruction -> one HTML file."""

from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from digs_warp.checks import DigsError
from digs_warp.commands.command import Command
from digs_warp.commands.output import check_output_file
from digs_warp.record import layout
from digs_warp.record.lock import sole_writer
from digs_warp.record.manifest import recorded_files


@dataclass(frozen=True, kw_only=True)
class Report(Command):
    """Write the report of a reconstruction: one HTML file that needs no network.

    It shows the verdict, the result in 3D, renders next to the held-out photographs, the recording, depth
    errors, quality over time, and the time of each stage. 'digs-warp run' writes the same at its end.
    """

    source: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="RECONSTRUCTION")]
    """A folder of 'digs-warp reconstruct' or 'run'."""

    out: Path | None = None
    """The file to write. Default: report.html in that folder."""

    overwrite: tyro.conf.FlagCreatePairsOff[bool] = False
    """Replace the file if it exists."""

    capture: Path | None = None
    """The capture that was reconstructed. Default: the one that was, if it is still where it was."""

    def execute(self) -> str:
        """Read, write, and say where the page is."""
        from digs_warp.data.capture import read_capture
        from digs_warp.pipeline.reconstruction import Reconstruction
        from digs_warp.show.report.page import write_report

        folder = self.source if self.source.is_dir() else self.source.parent
        page = self.out or folder / layout.REPORT
        check_output_file(page, self.overwrite, [self.source, self.capture])
        capture = read_capture(self.capture) if self.capture else None
        result = Reconstruction.load(self.source, capture)
        if capture is None:
            if result.capture is None:
                raise DigsError(
                    f"'{self.source}': its recording is not where it was; name it with --capture"
                )
            capture = read_capture(result.capture)
        with ExitStack() as stack:
            if (
                self.out is None
            ):  # one of the folder's own files: replaced with the result that it shows
                stack.enter_context(sole_writer(folder))
                stack.enter_context(recorded_files(folder, resume=True))
            write_report(capture, result, page)
        return f"{page}: {page.stat().st_size / 1e6:.1f} MB"
