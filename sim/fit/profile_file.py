"""Writes the fitted figures as a profile that `digs_warp.sim.camera.profiles` reads."""

import math
from pathlib import Path

from digs_warp.record.files import write_atomically
from digs_warp.sim.camera.profiles import IMAGE_FIGURES, RIG_FIGURES
from digs_warp.sim.fit.estimate import Estimate
from digs_warp.sim.fit.result import Fit


def write_profile(path: Path, fit: Fit, base: str, title: str) -> None:
    """Write a profile: the base's name, and the fitted figures with their errors in the notes.

    Args:
        path: a .yaml file.
        fit: its figures are written as far as they are figures of a profile.
        base: name of a built-in profile.
        title: of the camera.
    """
    import yaml

    known = (*IMAGE_FIGURES, *RIG_FIGURES)
    figures = {
        figure.name: {
            "value": rounded(figure.estimate),
            "origin": "measured",
            "note": f"{error_text(figure.estimate)}{figure.how}",
        }
        for figure in fit.figures
        if figure.name in known
    }
    content = {"title": title, "base": base, "figures": figures}
    text = yaml.safe_dump(content, sort_keys=False, width=110)
    write_atomically(path, f"# Fitted to: {fit.about}\n{text}".encode())


def decimals(estimate: Estimate) -> int:
    """Return how many decimals show two digits of the error, or five of the value without one."""
    scale, digits = (
        (estimate.error, 2) if estimate.error > 0 and math.isfinite(estimate.error)
        else (abs(estimate.value), 5)
    )  # fmt: skip
    return max(0, digits - 1 - math.floor(math.log10(scale))) if scale > 0 else 1


def rounded(estimate: Estimate) -> float:
    """Return the value with the digits that mean something, and one more."""
    return round(estimate.value, min(decimals(estimate) + 1, 12))


def error_text(estimate: Estimate) -> str:
    """Return the standard error as the beginning of a note; empty where there is none."""
    if not math.isfinite(estimate.error):
        return ""
    return f"+- {estimate.error:.2g}; " if estimate.error else "exact; "


def text(estimate: Estimate) -> str:
    """Return value and error for readers."""
    if not math.isfinite(estimate.value):
        return "unknown"
    places = min(decimals(estimate), 7)
    value = f"{estimate.value:,.{places}f}"
    if not math.isfinite(estimate.error):
        return f"{estimate.value:.3g}"
    return f"{value} ± {estimate.error:.{places}f}" if estimate.error else f"{value}, exact"
