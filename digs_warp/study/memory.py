"""How much memory a piece of work takes beyond what the process holds already (Linux)."""

from collections.abc import Callable
from pathlib import Path

_STATUS = Path("/proc/self/status")
_FORGET_PEAK = Path("/proc/self/clear_refs")


def peak_growth(work: Callable[[], object]) -> int | None:
    """Return by how much the resident memory grew at its peak while ``work`` ran [bytes].

    Files that were mapped and read count as far as they are resident. None where the system does not tell.
    """
    try:
        _FORGET_PEAK.write_text("5")  # the peak is now what is held now
        before = _kilobytes("VmRSS")
        work()
        return 1024 * max(0, _kilobytes("VmHWM") - before)
    except OSError:
        return None


def _kilobytes(name: str) -> int:
    return int(_STATUS.read_text().split(f"{name}:")[1].split()[0])
