"""The result of a fit: figures with errors, comparison with the simulation, and the profile file."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from digs_warp.geometry.camera import Intrinsics
from digs_warp.record.files import write_atomically
from digs_warp.sim.camera.profiles import IMAGE_FIGURES, RIG_FIGURES
from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.fit.estimate import Estimate

# Share of a figure that its error may not exceed.
TOO_LARGE = 2 / 3


@dataclass(frozen=True)
class Fitted:
    """A figure of the profile.

    Attributes:
        name: of the rig's field, or one of `digs_warp.sim.camera.profiles.IMAGE_FIGURES`.
        estimate: its value and standard error.
        how: where it comes from, for readers.
    """

    name: str
    estimate: Estimate
    how: str


@dataclass(frozen=True)
class Comparison:
    """A statistic of the recording beside that of its simulation.

    Attributes:
        name: of the statistic, with its unit.
        measured, simulated: unknown where the recording has nothing to tell it from.
    """

    name: str
    measured: Estimate
    simulated: Estimate


@dataclass(frozen=True)
class Fit:
    """The outcome of a fit.

    Attributes:
        about: what was recorded, in a phrase.
        figures: that the recording determines.
        kept: figures that it cannot determine, each with the reason; the base's are kept.
        comparisons: of statistics.
        doubts: what makes the figures less certain than their errors say.
    """

    about: str
    figures: tuple[Fitted, ...]
    kept: Mapping[str, str]
    comparisons: Sequence[Comparison]
    doubts: tuple[str, ...] = ()


def geometry(k: Intrinsics, baseline: float) -> list[Fitted]:
    """Return image size, focal length and baseline of a recording, which are taken for exact."""
    values = {"width": k.width, "height": k.height, "focal": k.fx, "baseline": baseline}
    how = "calibration of the recording"
    return [Fitted(name, Estimate(value, math.nan), how) for name, value in values.items()]


def sort_out(
    figures: Sequence[Fitted], base: StereoRig
) -> tuple[tuple[Fitted, ...], dict[str, str]]:
    """Return the figures that are known well enough, and why the others are not.

    An error of two thirds of the value, or of the base's where that is larger, tells too little.
    """
    good, poor = [], {}
    for figure in figures:
        value, error = figure.estimate.value, figure.estimate.error
        if error > TOO_LARGE * max(abs(value), abs(getattr(base, figure.name, value))):
            poor[figure.name] = (
                f"{value:.2g} with a standard error of {error:.2g}: not precise enough"
            )
        else:
            good.append(figure)
    return tuple(good), poor


def with_figures(rig: StereoRig, figures: Sequence[Fitted]) -> StereoRig:
    """Return the rig with the fitted figures that are fields of a rig."""
    values = {f.name: f.estimate.value for f in figures if hasattr(rig, f.name)}
    return replace(rig, **values)


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
