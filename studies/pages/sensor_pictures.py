"""Pictures of what each effect of the sensor does alone: off and on, side by side."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.sim.config import Tier
from digs_warp.sim.render.raycast import RaycastRenderer
from digs_warp.sim.sensor.color.image_noise import ReadNoise, ShotNoise
from digs_warp.sim.sensor.color.recorded import recorded_images
from digs_warp.sim.sensor.effects import AFTER_MATCHING, SECOND_SURFACES
from digs_warp.sim.sensor.effects.protocol import Choice, DepthEffect, Effect
from digs_warp.sim.sensor.facts import measure_facts
from digs_warp.sim.sensor.frame import FrameTruth, Sensed
from digs_warp.sim.sensor.tiers import effect_rng, sense
from studies.pages import save_figure
from studies.pages.still_life import (
    photograph,
    still_life,
    still_life_rig,
)

SEED = 0

# What other cameras than that of the pictures do with their matches.
WITHOUT_PICTURE = ("rejection", "smoothing", "speckle")

# Of the picture of the tiers: its name, and the full scale of its errors [px].
TIERS_PICTURE = "tiers"
SHOWN_ERROR = 2.0

# Full scales of the error maps [px]: the smallest one that holds MOST of the errors is used.
SCALES = (0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 25.0, 100.0)
MOST = 95  # percent

# Panels show the smallest window (a share of the frame's sides) that holds this share of the change.
WINDOWS = (0.35, 0.5, 1.0)
HELD = 0.3

# Largest ratio of disparities that the colors span; anything farther has the color of the far end.
LARGEST_RATIO = 8.0

# Errors above this are bad pixels, as Middlebury counts them [px].
BAD = 1.0

# Title, pixels, and how `imshow` draws them.
Panel = tuple[str, np.ndarray, dict[str, Any]]


@dataclass(frozen=True, eq=False)
class DepthFigure:
    """A frame before and after one effect.

    Attributes:
        truth: the frame.
        before: disparity without the effect [px].
        sensed: after the effect alone.
        changed: where the two differ, (height, width), bool.
    """

    truth: FrameTruth
    before: np.ndarray
    sensed: Sensed
    changed: np.ndarray


class SensorStudio:
    """The still life, ready to be photographed with any rig.

    Attributes:
        rig: the camera of the pictures.
        truth: the frame that it sees.
        facts: what the planner measures on it.
    """

    def __init__(self) -> None:
        self._scene, environment = still_life()
        self._renderer = RaycastRenderer(self._scene, environment)
        self.rig = still_life_rig()
        self.truth = photograph(self._renderer, self._scene, self.rig)
        self.facts = measure_facts([self.truth], self.rig)

    def depth_figure(self, effect: DepthEffect) -> DepthFigure:
        """Return the result of an effect alone."""
        truth = self.truth
        sensed = effect.apply(Sensed.of(truth), truth.rig, effect_rng(SEED, 0, effect.name))
        lost = ~sensed.known & ~np.isnan(truth.disparity)
        with np.errstate(invalid="ignore"):
            changed = lost | (np.abs(sensed.disparity - truth.disparity) > 0)
        return DepthFigure(truth, truth.disparity, sensed, changed)

    def surface_strip(self, effect: Effect, path: Path) -> None:
        """Draw what the search finds with and without the candidates of second surfaces of a kind."""
        off, on = self.sensed("guided"), self.sensed("guided", effect.name)
        with np.errstate(invalid="ignore"):
            changed = (off.known != on.known) | (np.abs(off.disparity - on.disparity) > BAD)
        depth_strip(DepthFigure(self.truth, off.disparity, on, changed), path)

    def sensed(self, tier: Tier, *effects: str) -> Sensed:
        """Return what a tier measures with some effects on depth, and image noise."""
        recorded = recorded_images(self.truth, (ShotNoise(), ReadNoise()), SEED)
        plan = [Choice(name, True, "", "", "") for name in effects]
        return sense(self.truth, tier, plan, SEED, recorded=recorded)


def depth_strip(figure: DepthFigure, path: Path) -> None:
    """Draw left image, disparity off and on, and the error, as one JPEG."""
    from matplotlib.colors import LogNorm

    truth, sensed = figure.truth, figure.sensed
    rows, columns = window_of(figure.changed)
    error = sensed.disparity - truth.disparity
    scale = full_scale(np.abs(error[figure.changed]))
    low, high = np.nanpercentile(truth.disparity[rows, columns], [1, 99])
    # Equal ratios of disparity are equal steps of color, so that far things keep theirs beside near ones.
    low = max(low, high / LARGEST_RATIO)
    norm = LogNorm(low, max(high, 1.5 * low), clip=True)
    near_far = {"cmap": with_holes("turbo"), "norm": norm}
    signed = {"cmap": with_holes("RdBu"), "vmin": -scale, "vmax": scale}
    panels: list[Panel] = [
        ("left image", truth.image, {}),
        ("disparity, off", figure.before, near_far),
        ("disparity, on", sensed.disparity, near_far),
        (f"error, ±{scale:g} px", error, signed),
    ]
    draw_panels([(title, pixels[rows, columns], style) for title, pixels, style in panels], path)


def tiers_strip(studio: SensorStudio, path: Path) -> None:
    """Draw the left image and the errors of three tiers on it, as one JPEG."""
    true = studio.truth.disparity
    surfaces = [effect.name for effect in SECOND_SURFACES]
    signed = {"cmap": with_holes("RdBu"), "vmin": -SHOWN_ERROR, "vmax": SHOWN_ERROR}
    panels: list[Panel] = [("left image", studio.truth.image, {})]
    tiers: tuple[Tier, ...] = ("law", "guided", "matcher")
    for tier in tiers:
        error = studio.sensed(tier, *surfaces).disparity - true
        panels.append((f"{tier}, error ±{SHOWN_ERROR:g} px", error, signed))
    draw_panels(panels, path)


def draw_all(studio: SensorStudio, folder: Path) -> None:
    """Draw the strip of every effect into ``folder``."""
    for effect in AFTER_MATCHING:
        if effect.name in WITHOUT_PICTURE:
            continue
        depth_strip(studio.depth_figure(effect), folder / f"{effect.name}.jpg")
    for effect in SECOND_SURFACES:
        studio.surface_strip(effect, folder / f"{effect.name}.jpg")
    tiers_strip(studio, folder / f"{TIERS_PICTURE}.jpg")


def window_of(changed: np.ndarray) -> tuple[slice, slice]:
    """Return the smallest window that holds enough of the change."""
    height, width = changed.shape
    sums = np.pad(changed.astype(np.int64).cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
    for share in WINDOWS:
        h, w = round(share * height), round(share * width)
        inside = sums[h:, w:] - sums[:-h, w:] - sums[h:, :-w] + sums[:-h, :-w]
        if inside.max() >= HELD * sums[-1, -1]:
            # Several windows may hold the same: the middle one.
            top, left = np.argwhere(inside == inside.max()).mean(axis=0).astype(int).tolist()
            return slice(top, top + h), slice(left, left + w)
    return slice(0, height), slice(0, width)


def full_scale(errors: np.ndarray) -> float:
    """Return the smallest of the scales that holds most of the errors [px]."""
    known = errors[np.isfinite(errors)]
    typical = float(np.percentile(known, MOST)) if len(known) else SCALES[0]
    return next((scale for scale in SCALES if typical <= scale), SCALES[-1])


def with_holes(name: str) -> Any:
    """Return a color map that draws missing values black."""
    import matplotlib

    return matplotlib.colormaps[name].with_extremes(bad="black")


def draw_panels(panels: Sequence[Panel], path: Path) -> None:
    """Draw titled pictures side by side into a JPEG file."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(3.3 * len(panels), 2.32), dpi=100)
    for axis, (title, pixels, style) in zip(figure.subplots(1, len(panels)), panels, strict=True):
        axis.imshow(pixels, interpolation="nearest", **style)
        axis.set_title(title, fontsize=10)
        axis.axis("off")
    figure.subplots_adjust(0.003, 0.01, 0.997, 0.9, wspace=0.015)
    save_figure(figure, path, 85)
