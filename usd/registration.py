"""Our rules as validators of UsdValidation, for everything in this process that validates scenes."""

from typing import TYPE_CHECKING

from digs_warp.checks import UsdError
from digs_warp.usd.field import is_field
from digs_warp.usd.field_rules import check_field, check_stage
from digs_warp.usd.findings import Finding
from digs_warp.usd.validate import OURS

if TYPE_CHECKING:
    from pxr import Sdf, Usd, UsdValidation

FIELD_CHECKER = f"{OURS}GaussianSplatChecker"
STAGE_CHECKER = f"{OURS}SceneChecker"


def register() -> None:
    """Register our rules with UsdValidation; a second call does nothing.

    Raises:
        UsdError: this version of OpenUSD takes no validators from Python.
    """
    from pxr import Usd, UsdValidation

    registry = UsdValidation.ValidationRegistry()
    if not hasattr(registry, "RegisterPrimValidator"):
        version = ".".join(map(str, Usd.GetVersion()))
        raise UsdError(
            f"OpenUSD {version} takes no validators from Python; install usd-core 26.11, or call "
            "digs_warp.usd.validate.validate, which needs no registration"
        )
    if registry.HasValidator(FIELD_CHECKER):
        return
    registry.RegisterPrimValidator(
        UsdValidation.ValidatorMetadata(
            name=FIELD_CHECKER,
            keywords=["digs_warp", "GaussianSplats"],
            doc="Values, metadata, color space and extent of Gaussian splats.",
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
        f"{finding.where}: {finding.message}",  # where may name a time
    )
