"""Runs one case: recording -> reconstruction -> numbers. Recordings are shared between cases."""

import json
import logging
import resource
import shutil
import sys
from pathlib import Path
from typing import Any

from digs_warp.capture import Capture
from digs_warp.log import read_json, versions
from digs_warp.study.engine.case import Case
from digs_warp.study.engine.overrides import with_settings

CAPTURES = "captures"
WORK = "work"


def record_case(case: Case, folder: Path) -> Capture:
    """Return the recording of a case; it is made when the study's ``folder`` does not hold it yet."""
    from sim.config import SimulateConfig
    from sim.record import simulate

    config = with_settings(SimulateConfig(), case.recording)
    return simulate(config, folder / CAPTURES / case.recording_key, resume=True)


def run_case(case: Case, folder: Path, keep: bool = False) -> dict[str, Any]:
    """Reconstruct and return what was measured, JSON-like.

    The keys: ``metrics`` (held-out quality of the result), ``course`` (quality along iterations and
    seconds), ``seconds`` (stages; compiling kernels apart), ``results`` (counts), ``memory_mb`` (peak of
    this process), ``versions``.

    Args:
        case: its recording is taken from the study's ``folder`` or made there.
        folder: of the study.
        keep: leave the reconstruction in the folder's ``work``; otherwise only the numbers stay.
    """
    from digs_warp.reconstruct import ReconstructConfig, reconstruct

    capture = record_case(case, folder)
    config = with_settings(ReconstructConfig(), case.reconstruction)
    work = folder / WORK / case.key
    shutil.rmtree(work, ignore_errors=True)
    with _CompileTimes() as compiled:
        reconstruct(capture, config, work)
    measured = _measure(work) | {
        "recording_seconds": read_json(capture.folder / "run.json", "run record")["seconds"],
        "memory_mb": _peak_memory_mb(),
        "versions": versions(),
    }
    measured["seconds"]["compile kernels"] = round(compiled.seconds, 3)
    if not keep:
        shutil.rmtree(work)
    return measured


def _measure(work: Path) -> dict[str, Any]:
    run = read_json(work / "run.json", "run record")
    lines = (work / "training.jsonl").read_text(encoding="utf-8").splitlines()
    course = [line for line in map(json.loads, lines) if "psnr" in line]
    return {
        "metrics": read_json(work / "evaluation.json", "evaluation")["mean"],
        "course": course,
        "seconds": run["seconds"],
        "results": run["results"],
    }


def _peak_memory_mb() -> float:
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    # Linux counts kibibytes, macOS bytes.
    return round(peak / (1 << 20 if sys.platform == "darwin" else 1 << 10), 1)


class _CompileTimes(logging.Handler):
    """Adds up what compiling kernels takes: it happens once per machine and belongs to no stage."""

    def __init__(self) -> None:
        super().__init__()
        self.seconds = 0.0
        self._logger = logging.getLogger("digs_warp.kernels")

    def emit(self, record: logging.LogRecord) -> None:
        if record.msg.startswith("compiled") and isinstance(record.args, tuple):
            self.seconds += float(record.args[1])  # pyright: ignore[reportArgumentType]

    def __enter__(self) -> "_CompileTimes":
        self._level = self._logger.level
        self._logger.setLevel(logging.INFO)
        self._logger.addHandler(self)
        return self

    def __exit__(self, *error: object) -> None:
        self._logger.removeHandler(self)
        self._logger.setLevel(self._level)
