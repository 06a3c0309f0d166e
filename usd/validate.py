"""Checks a USD scene in every combination of its variants: our rules for splats, and OpenUSD's validators."""

from dataclasses import asdict, dataclass, replace
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

from digs_warp.record.files import to_json
from digs_warp.usd.field import find_fields
from digs_warp.usd.files import opened_stage
from digs_warp.usd.rules import Finding, check_field, check_stage
from digs_warp.usd.walk import MAX_COMBINATIONS, variant_combinations
from digs_warp.words import counted

if TYPE_CHECKING:
    from pxr import Usd, UsdValidation


@dataclass(frozen=True)
class Report:
    """The result of a validation.

    Attributes:
        path: the scene.
        findings: errors first.
        combinations: how many combinations of variants were looked at.
        complete: whether those are all.
    """

    path: Path
    findings: tuple[Finding, ...]
    combinations: int
    complete: bool

    @property
    def ok(self) -> bool:
        """Whether no error was found."""
        return not any(finding.severity == "error" for finding in self.findings)

    def text(self) -> str:
        """Return the report for a terminal."""
        errors = sum(finding.severity == "error" for finding in self.findings)
        only = "" if self.complete else "only the first "
        summary = (
            f"{self.path}: {counted(errors, 'error')}, "
            f"{counted(len(self.findings) - errors, 'warning')} in "
            f"{only}{counted(self.combinations, 'combination')} of variants"
        )
        return "\n".join([*map(str, self.findings), summary])

    def json(self) -> str:
        """Return the report as JSON: file, ok, findings, combinations."""
        findings = [asdict(finding) for finding in self.findings]
        content = {"file": self.path, "ok": self.ok, "findings": findings}
        return to_json(content | {"combinations": self.combinations})


def validate(path: Path) -> Report:
    """Check a scene.

    Raises:
        UsdError: the file is missing or cannot be opened as USD.
    """
    path = Path(path)
    with opened_stage(path) as stage:
        return _report(stage, path)


def _report(stage: "Usd.Stage", path: Path) -> Report:
    from pxr import UsdValidation

    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    context = UsdValidation.ValidationContext(validators)
    found: dict[Finding, list[str]] = {}  # with the choices of variants that show it
    combinations = 0
    every = variant_combinations(stage)
    for chosen in islice(every, MAX_COMBINATIONS):
        combinations += 1
        label = ", ".join(f"{name}={variant}" for (_, name), variant in chosen.items())
        here = [*check_stage(stage), *map(_finding, context.Validate(stage))]
        here += [finding for prim in find_fields(stage) for finding in check_field(prim)]
        for finding in dict.fromkeys(here):
            found.setdefault(finding, []).append(label)
    findings = [
        replace(finding, variants="" if len(labels) == combinations else "; ".join(labels))
        for finding, labels in found.items()
    ]
    findings.sort(key=lambda finding: finding.severity)  # "error" before "warning"
    return Report(path, tuple(findings), combinations, next(every, None) is None)


def _finding(error: "UsdValidation.ValidationError") -> Finding:
    """Return a finding of UsdValidation as ours."""
    from pxr import UsdValidation

    severe = error.GetType() == UsdValidation.ValidationErrorType.Error
    sites = error.GetSites()
    where = str(sites[0].GetPrim().GetPath()) if sites and sites[0].IsPrim() else ""
    severity = "error" if severe else "warning"
    return Finding(str(error.GetIdentifier()), severity, str(error.GetMessage()), where)
