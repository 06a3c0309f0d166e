"""What a fit found: figures for a profile, what it could not determine, and measured beside simulated."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from digs_warp.geometry.camera import Intrinsics
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
class Series:
    """A statistic over the distances of a recording, for a chart.

    Attributes:
        title: of the chart.
        x_label, y_label: of its axes.
        x: shared by both.
        measured, simulated: values with errors.
    """

    title: str
    x_label: str
    y_label: str
    x: Sequence[float]
    measured: Sequence[Estimate]
    simulated: Sequence[Estimate]


@dataclass(frozen=True)
class Fit:
    """The outcome of a fit.

    Attributes:
        about: what was recorded, in a phrase.
        figures: that the recording determines.
        kept: figures that it cannot determine, each with the reason; the base's are kept.
        tables: comparisons by title.
        series: for charts.
        doubts: what makes the figures less certain than their errors say.
    """

    about: str
    figures: tuple[Fitted, ...]
    kept: Mapping[str, str]
    tables: Mapping[str, Sequence[Comparison]]
    series: tuple[Series, ...] = ()
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
