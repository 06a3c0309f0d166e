# pxr comes without type stubs:
# pyright: reportAttributeAccessIssue=false
"""Checks a USD scene: our rules for splats, the validators of OpenUSD, NVIDIA's rule where it is installed.

Our rules are registered with UsdValidation, so that other programs of the same process that validate
scenes run them, too: ``digs_warp:GaussianSplatChecker`` for fields, ``digs_warp:SceneChecker`` for stages.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

from usd.field import find_fields, is_field
from usd.field_rules import check_field, check_stage, sample_times
from usd.files import opened_stage
from usd.findings import Check, Finding, Report
from usd.package import check_package
from usd.variants import variant_combinations

if TYPE_CHECKING:
    from pxr import Sdf, Usd, UsdValidation

OURS = "digs_warp:"
FIELD_CHECKER = f"{OURS}GaussianSplatChecker"
STAGE_CHECKER = f"{OURS}SceneChecker"

# More combinations of variants than this are not looked at one by one; the report says so.
MAX_COMBINATIONS = 256


def register() -> None:
    """Register our rules with UsdValidation; a second call does nothing."""
    from pxr import UsdValidation

    registry = UsdValidation.ValidationRegistry()
    if registry.HasValidator(FIELD_CHECKER):
        return
    registry.RegisterPrimValidator(
        UsdValidation.ValidatorMetadata(
            name=FIELD_CHECKER,
            keywords=["digs_warp", "GaussianSplats"],
            doc="Values, metadata, colour space and extent of Gaussian splats.",
            isTimeDependent=True,
        ),
        _validate_prim,
    )
    registry.RegisterStageValidator(
        UsdValidation.ValidatorMetadata(
            name=STAGE_CHECKER,
            keywords=["digs_warp", "GaussianSplats"],
            doc="One field of splats, no paths that leave the scene.",
        ),
        _validate_stage,
    )


def validate(path: Path) -> Report:
    """Check a scene in every combination of its variants and at all time samples of its splats.

    Raises:
        UsdError: the file is missing or cannot be opened as USD.
    """
    path = Path(path)
    with opened_stage(path) as stage:
        return _report(stage, path)


def _report(stage: "Usd.Stage", path: Path) -> Report:
    package = list(check_package(path))
    register()
    ours, stock = _Collected(), _Collected()
    combinations = samples = 0
    for prim in _inactive_fields(stage):
        samples += len(sample_times(prim))
        for finding in check_field(prim):
            ours.add(finding, "")
    every = variant_combinations(stage)
    for chosen in islice(every, MAX_COMBINATIONS):
        combinations += 1
        samples += sum(len(sample_times(prim)) for prim in find_fields(stage))
        label = ", ".join(f"{name}={variant}" for (_, name), variant in chosen.items())
        for error in _context().Validate(stage):
            of_ours = error.GetIdentifier().startswith(OURS)
            (ours if of_ours else stock).add(_finding(error, of_ours), label)
    left_out = next(every, None) is not None
    note = f"only the first {MAX_COMBINATIONS} combinations of variants" if left_out else ""
    groups = {
        "splats and scene": ours.findings(combinations),
        "OpenUSD validators": stock.findings(combinations),
    }
    checks = [_check_of(name, findings, note) for name, findings in groups.items()]
    if path.suffix.lower() == ".usdz":
        checks.append(_check_of("package", package))
    else:
        checks.append(Check("package", "not checked", "not a .usdz file"))
    nvidia, nvidia_findings = _run_nvidia(path)
    checks.append(nvidia)
    findings = [*package, *groups["splats and scene"], *groups["OpenUSD validators"]]
    findings += nvidia_findings
    findings.sort(key=lambda finding: finding.severity)  # "error" before "warning"
    return Report(path, tuple(checks), tuple(findings), combinations, samples)


def _inactive_fields(stage: "Usd.Stage") -> "Iterator[Usd.Prim]":
    """Switch on each inactive field in turn (in the session layer); validators pass over those."""
    from pxr import Usd

    for path in [prim.GetPath() for prim in stage.TraverseAll() if not prim.IsActive()]:
        with Usd.EditContext(stage, stage.GetSessionLayer()):
            stage.GetPrimAtPath(path).SetActive(True)
            if is_field(stage.GetPrimAtPath(path)):
                yield stage.GetPrimAtPath(path)
            stage.GetPrimAtPath(path).ClearActive()


class _Collected:
    """Findings of several combinations of variants; what all of them share is said once."""

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


def _context() -> "UsdValidation.ValidationContext":
    from pxr import UsdValidation

    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    return UsdValidation.ValidationContext(validators)


def _check_of(name: str, findings: list[Finding], note: str = "") -> Check:
    failed = any(finding.severity == "error" for finding in findings)
    return Check(name, "failed" if failed else "passed", note)


def _finding(error: "UsdValidation.ValidationError", ours: bool) -> Finding:
    """Return a finding of UsdValidation as ours."""
    from pxr import UsdValidation

    severe = error.GetType() == UsdValidation.ValidationErrorType.Error
    sites = error.GetSites()
    message = str(error.GetMessage())
    if ours:  # the place is more than the prim: it may name a time
        where, _, message = message.partition(_SEPARATOR)
        return Finding(str(error.GetName()), "error" if severe else "warning", message, where)
    where = str(sites[0].GetPrim().GetPath()) if sites and sites[0].IsPrim() else ""
    return Finding(str(error.GetIdentifier()), "error" if severe else "warning", message, where)


# Between place and message in the errors of our rules.
_SEPARATOR = ": "


def _validate_prim(prim: "Usd.Prim", _times: object) -> "list[UsdValidation.ValidationError]":
    if not is_field(prim):
        return []
    return [_error(finding, prim.GetStage(), prim.GetPath()) for finding in check_field(prim)]


def _validate_stage(stage: "Usd.Stage", _times: object) -> "list[UsdValidation.ValidationError]":
    from pxr import Sdf

    root = Sdf.Path.absoluteRootPath
    return [_error(finding, stage, root) for finding in check_stage(stage)]


def _error(
    finding: Finding, stage: "Usd.Stage", place: "Sdf.Path"
) -> "UsdValidation.ValidationError":
    from pxr import UsdValidation

    kinds = UsdValidation.ValidationErrorType
    return UsdValidation.ValidationError(
        finding.rule,
        kinds.Error if finding.severity == "error" else kinds.Warn,
        [UsdValidation.ValidationErrorSite(stage, place)],
        f"{finding.where}{_SEPARATOR}{finding.message}",
    )


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
