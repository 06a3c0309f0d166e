"""Checks a USD scene: our rules for splats, OpenUSD's validators, NVIDIA's rule where it is installed."""

from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

from digs_warp.usd.field import find_fields
from digs_warp.usd.files import opened_stage
from digs_warp.usd.findings import Check, Finding, Report
from digs_warp.usd.rules import check_field, check_stage
from digs_warp.usd.walk import MAX_COMBINATIONS, variant_combinations

if TYPE_CHECKING:
    from pxr import Usd, UsdValidation


def validate(path: Path) -> Report:
    """Check a scene in every combination of its variants.

    Raises:
        UsdError: the file is missing or cannot be opened as USD.
    """
    path = Path(path)
    with opened_stage(path) as stage:
        return _report(stage, path)


def _report(stage: "Usd.Stage", path: Path) -> Report:
    context = _stock_context()
    ours, stock = _Collected(), _Collected()
    combinations = 0
    every = variant_combinations(stage)
    for chosen in islice(every, MAX_COMBINATIONS):
        combinations += 1
        label = ", ".join(f"{name}={variant}" for (_, name), variant in chosen.items())
        for finding in check_stage(stage):
            ours.add(finding, label)
        for prim in find_fields(stage):
            for finding in check_field(prim):
                ours.add(finding, label)
        for error in context.Validate(stage):
            stock.add(_finding(error), label)
    left_out = next(every, None) is not None
    note = f"only the first {MAX_COMBINATIONS} combinations of variants" if left_out else ""
    groups = {
        "splats and scene": ours.findings(combinations),
        "OpenUSD validators": stock.findings(combinations),
    }
    checks = [_check_of(name, findings, note) for name, findings in groups.items()]
    nvidia, nvidia_findings = _run_nvidia(path)
    checks.append(nvidia)
    findings = [*groups["splats and scene"], *groups["OpenUSD validators"], *nvidia_findings]
    findings.sort(key=lambda finding: finding.severity)  # "error" before "warning"
    return Report(path, tuple(checks), tuple(findings), combinations)


class _Collected:
    """Findings of several combinations of variants; those of all combinations are reported once."""

    def __init__(self) -> None:
        self._labels: dict[Finding, list[str]] = {}

    def add(self, finding: Finding, label: str) -> None:
        labels = self._labels.setdefault(finding, [])
        if label not in labels:
            labels.append(label)

    def findings(self, combinations: int) -> list[Finding]:
        return [
            replace(finding, variants="" if len(labels) == combinations else "; ".join(labels))
            for finding, labels in self._labels.items()
        ]


def _stock_context() -> "UsdValidation.ValidationContext":
    from pxr import UsdValidation

    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    return UsdValidation.ValidationContext(validators)


def _check_of(name: str, findings: list[Finding], note: str = "") -> Check:
    failed = any(finding.severity == "error" for finding in findings)
    return Check(name, "failed" if failed else "passed", note)


def _finding(error: "UsdValidation.ValidationError") -> Finding:
    """Return a finding of UsdValidation as ours."""
    from pxr import UsdValidation

    severe = error.GetType() == UsdValidation.ValidationErrorType.Error
    sites = error.GetSites()
    where = str(sites[0].GetPrim().GetPath()) if sites and sites[0].IsPrim() else ""
    severity = "error" if severe else "warning"
    return Finding(str(error.GetIdentifier()), severity, str(error.GetMessage()), where)


def _run_nvidia(path: Path) -> tuple[Check, list[Finding]]:
    """Run NVIDIA's rule VG.035 (package usd-validation-nvidia), which its own tool leaves out by default."""
    name = "NVIDIA VG.035"
    try:
        import usd_validation_nvidia as nvidia  # pyright: ignore[reportMissingImports]
    except ImportError:
        return Check(name, "not checked", "install usd-validation-nvidia"), []
    engine = nvidia.ValidationEngine(init_rules=False, variants=True)
    engine.enable_rule(nvidia.GaussianSplatSchemaChecker)
    issues = engine.validate(str(path)).issues()
    findings = [
        Finding(
            "NVIDIA VG.035",
            "warning" if issue.severity == nvidia.IssueSeverity.WARNING else "error",
            issue.message,
            str(getattr(issue.at, "path", "") or ""),
        )
        for issue in issues
    ]
    return _check_of(name, findings, f"version {nvidia.__version__}"), findings
