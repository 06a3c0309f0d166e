"""`digs-warp check`: what is wrong with a capture, and how to mend it, before anyone waits for a result."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from digs_warp.checks import CaptureError
from digs_warp.commands.command import Command
from digs_warp.commands.output import JsonFile, check_output_file
from digs_warp.record.files import to_json
from digs_warp.words import counted

if TYPE_CHECKING:
    from digs_warp.check.check import CheckResult
    from digs_warp.check.findings import Finding


@dataclass(frozen=True, kw_only=True)
class Check(JsonFile, Command):
    """Say what is wrong with a capture, and how to mend it; the exit code is 1 if there is an error."""

    capture: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="CAPTURE")]
    """A capture folder."""

    write_ignore_mask: Path | None = None
    """Also mark in this image what moves with the camera, for 'reconstruct --ignore-mask'."""

    def execute(self) -> str:
        """Look; a capture with errors is raised, so that the exit code tells."""
        from digs_warp.check.check import check_capture
        from digs_warp.check.recording import write_attached
        from digs_warp.data.capture import read_capture

        self.check(self.capture)
        mask = self.write_ignore_mask
        if mask is not None:
            check_output_file(mask, self.overwrite, [self.capture], flag="--write-ignore-mask")
        capture = read_capture(self.capture)
        found = check_capture(capture)
        self.write(to_json(found.as_json()))
        if mask is not None:
            write_attached(capture, mask)
        text = "\n".join([f"{capture}: {counted(len(capture), 'frame')}", *_lines(found)])
        if found.has_errors:
            raise CaptureError(text)
        return text


def _lines(found: "CheckResult") -> list[str]:
    part = " in what could be checked" if found.not_checked else ""
    findings = [line for each in found.findings for line in _of_finding(each)]
    return [
        *(findings or [f"nothing wrong was found{part}"]),
        *(f"measured: {each}" for each in _measured(found)),
        *(f"not checked: {each}" for each in found.not_checked),
    ]


def _of_finding(finding: "Finding") -> tuple[str, str]:
    degree = "error" if finding.is_error else "warning"
    return f"{degree}: {finding.kind}: {finding.what}", f"  to mend it: {finding.remedy}"


def _measured(found: "CheckResult") -> list[str]:
    words = []
    if found.agreement is not None:
        words.append(f"neighboring frames agree to {found.agreement.score:.0%}")
    if found.exposure_change is not None:
        words.append(
            f"the exposure changes by {found.exposure_change:.2f} stops from frame to frame"
        )
    return words
