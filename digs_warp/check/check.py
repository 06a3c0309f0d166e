"""Looks at a capture before any work and names what does not fit together, with the likely cause."""

from dataclasses import asdict, dataclass
from typing import Any

from digs_warp.check import recording
from digs_warp.check.evidence import Agreement, Evidence
from digs_warp.check.findings import ASKERS, CHECKS, ERRORS, Asker, Finding
from digs_warp.data.capture import Capture, object_alone
from digs_warp.data.decoded import decoded_once
from digs_warp.data.layers import Layer


@dataclass(frozen=True)
class CheckResult:
    """What the checks found.

    Attributes:
        findings: what does not fit or could be better, the gravest first; empty for a good capture.
        agreement: of neighboring frames as recorded; None where poses or depth are unknown.
        exposure_change: median from frame to frame [stops]; None: too little in common, or not asked for.
        not_checked: what could not be looked at, and why.
    """

    findings: tuple[Finding, ...]
    agreement: Agreement | None
    exposure_change: float | None = None
    not_checked: tuple[str, ...] = ()

    @property
    def has_errors(self) -> bool:
        """Whether no good reconstruction can come of the capture as it is."""
        return any(each.is_error for each in self.findings)

    def as_json(self) -> dict[str, Any]:
        """Return everything as JSON values."""
        return {
            "findings": [asdict(each) for each in self.findings],
            "agreement": None if self.agreement is None else asdict(self.agreement),
            "photographs": {"exposure_change": self.exposure_change},
            "not_checked": list(self.not_checked),
        }


@decoded_once()  # several checks look at the same frames
def check_capture(
    capture: Capture, asker: Asker = "check", *, poses: bool = True, masks: bool = True
) -> CheckResult:
    """Return what does not fit together in a capture; a whole check takes seconds, the others less than one.

    A capture without poses is only checked for the range of its depth, its alignment and its masks; one
    without depth for little.

    Args:
        capture: the recording.
        asker: how much is looked at.
        poses: whether its poses matter.
        masks: whether its masks matter.

    Raises:
        DigsError: a file that cannot be read.
    """
    evidence = Evidence(capture, poses, masks)
    if recording.follows_object(evidence):
        evidence = Evidence(object_alone(capture), poses, masks)
    findings: list[Finding] = []
    for check in CHECKS:
        asked = ASKERS.index(check.asked_by) <= ASKERS.index(asker)
        kinds = {each.kind for each in findings} | {ERRORS for each in findings if each.is_error}
        if asked and not kinds & set(check.unless):
            found = check.look(evidence)
            findings += [found] if found else []
    seen = (tuple(findings), evidence.agreement)
    if asker != "check":
        return CheckResult(*seen)
    exposure_change = evidence.once(recording.median_exposure_change)
    return CheckResult(*seen, exposure_change, _not_checked(evidence))


def _not_checked(evidence: Evidence) -> tuple[str, ...]:
    capture = evidence.capture
    has_depth, has_masks = (
        any(frame.has(layer) for frame in capture.frames) for layer in (Layer.DEPTH, Layer.MASK)
    )
    missing = []
    if not has_depth:
        missing.append("units, focal length, pose convention, moving things: need depth")
    elif not capture.knows_poses:
        missing.append("focal length, pose convention, moving things: need poses")
    elif evidence.agreement is None or not evidence.agreement.is_known:
        missing.append(
            "units, focal length, pose convention: the images show too little, or too little of it twice"
        )
    if not has_masks:
        missing.append("masks: the recording has none")
    return tuple(missing)
