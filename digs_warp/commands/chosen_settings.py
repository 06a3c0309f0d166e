"""`reconstruct --recommended`: settings that a time budget chooses instead of the user."""

import logging
from pathlib import Path
from typing import TYPE_CHECKING, Any

from digs_warp.checks import DigsError
from digs_warp.commands.reconstruction_options import ReconstructionOptions
from digs_warp.record.layout import RUN_RECORD
from digs_warp.record.run_log import RunRecord
from digs_warp.record.settings import settings_from_json

if TYPE_CHECKING:
    from digs_warp.data.capture import Capture
    from digs_warp.pipeline.reconstruct import ReconstructConfig

_log = logging.getLogger(__name__)

# What a recommendation sets, or contradicts: the flag, and where its value is.
CHOSEN = {
    "--strategy": "init.strategy",
    "--voxel-size": "init.voxel_size",
    "voxel_unit": "init.voxel_unit",
    "--target-points": "init.target_points",
    "max_points": "init.max_points",
    "--iterations": "train.stop.iterations",
    "--density": "train.density.strategy",
}


def check_left_open(options: ReconstructionOptions) -> None:
    """Raise a `DigsError` when a flag asks for something else than its default that a recommendation sets."""
    usual = ReconstructionOptions()
    for flag, name in CHOSEN.items():
        if _value(options, name) != _value(usual, name):
            raise DigsError(f"--recommended chooses {flag}; leave one of the two out")


def recommended_config(
    capture: "Capture", config: "ReconstructConfig", budget: float, before: Path | None
) -> tuple["ReconstructConfig", dict[str, Any]]:
    """Return the settings that fit a time, and how they were chosen, as run.json holds it.

    Args:
        capture: the recording.
        config: the user's settings; what is not chosen stays.
        budget: time of the whole reconstruction [s].
        before: folder of an interrupted run to go on with, whose choice counts; None: there is none.

    Raises:
        DigsError: nothing fits, or the interrupted run was given another time or none.
    """
    from digs_warp.study.engine.case import with_settings
    from digs_warp.study.recommend.choose import reasons, recommend
    from digs_warp.study.recommend.published import read_studies

    record = RunRecord.find(before) if before is not None else None
    if record is not None:
        return _as_before(record, budget, before)
    found = recommend(capture, budget, config, read_studies())
    why = reasons(found)
    for name in ("setting", "seconds", "machine"):
        _log.info("%s: %s", name, why[name])
    return with_settings(config, found.settings), found.to_json() | {"because": why}


def _as_before(
    record: RunRecord, budget: float, folder: Path | None
) -> tuple["ReconstructConfig", dict[str, Any]]:
    from digs_warp.pipeline.reconstruct import ReconstructConfig

    given = record.recommended.get("budget")
    if given != budget:
        raise DigsError(
            f"'{folder}': started with {'no --recommended' if given is None else f'--recommended {given:g}s'}"
            f", not {budget:g}s; resume with the same, or start again with --overwrite"
        )
    where = f"run record '{folder}/{RUN_RECORD}', settings"
    return settings_from_json(ReconstructConfig, record.settings, where), record.recommended


def _value(options: Any, name: str) -> Any:
    for part in name.split("."):
        options = getattr(options, part)
    return options
