"""Pictures of what each effect of the sensor does alone: off and on, side by side."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.geometry.camera import Camera
from digs_warp.geometry.rigid import rigid
from digs_warp.sim.camera.profiles import load_profile
from digs_warp.sim.camera.shutter import Shutter, ShutteredEye
from digs_warp.sim.config import Tier
from digs_warp.sim.render.raycast import RaycastRenderer
from digs_warp.sim.render.views import Projected
from digs_warp.sim.sensor.color import (
    CALIBRATION_DRIFT,
    IMAGE_BLUR,
    PIXEL_EFFECTS,
    PROJECTOR,
    ROLLING_SHUTTER,
)
from digs_warp.sim.sensor.color.adaptation import Adaptation, targets
from digs_warp.sim.sensor.color.encoding import decode, encode
from digs_warp.sim.sensor.color.image_noise import ReadNoise, ShotNoise
from digs_warp.sim.sensor.color.protocol import EyeImages, PixelEffect
from digs_warp.sim.sensor.color.recorded import recorded_images
from digs_warp.sim.sensor.color.rendering import ImageBlur, RollingShutter
from digs_warp.sim.sensor.effects import AFTER_MATCHING, SECOND_SURFACES
from digs_warp.sim.sensor.effects.protocol import Choice, DepthEffect, SensorEffect
from digs_warp.sim.sensor.facts import measure_facts
from digs_warp.sim.sensor.frame import FrameTruth, Sensed
from digs_warp.sim.sensor.infrared.pair import infrared_image, stands_out, with_dots
from digs_warp.sim.sensor.tiers import effect_rng, sense
from studies.pages import save_figure
from studies.pages.still_life import (
    RIGHT_SEED,
    SAMPLES,
    photograph,
    pose_at,
    still_life,
    still_life_camera,
    still_life_rig,
)

SEED = 0

# A drift of common size does not show in a picture; this many times as much does.
SHOWN_DRIFT = 20.0

# What other cameras than that of the pictures do with their matches.
WITHOUT_PICTURE = ("rejection", "smoothing", "speckle", "lens-blur")

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
        self.facts = measure_facts([replace(self.truth, dots_show=self._dots_show())], self.rig)

    def depth_figure(self, effect: DepthEffect) -> DepthFigure:
        """Return the result of an effect alone."""
        truth = self.truth
        sensed = effect.apply(Sensed.of(truth), truth.rig, effect_rng(SEED, 0, effect.name))
        lost = ~sensed.known & ~np.isnan(truth.disparity)
        with np.errstate(invalid="ignore"):
            changed = lost | (np.abs(sensed.disparity - truth.disparity) > 0)
        return DepthFigure(truth, truth.disparity, sensed, changed)

    def surface_strip(self, effect: SensorEffect, path: Path) -> None:
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

    def shuttered(self, effect: RollingShutter | ImageBlur) -> np.ndarray:
        """Return the left image through a shutter that has an effect alone."""
        facts = self.facts
        if isinstance(effect, RollingShutter):
            shutter = Shutter(
                bands=effect.bands(facts, self.rig), readout_time=self.rig.readout_time
            )
        else:
            shutter = Shutter(views=effect.views(facts), exposure_time=self.rig.exposure_time)
        eye = ShutteredEye(self._renderer, shutter, self.rig.intrinsics, pose_at)
        return eye.photograph(SAMPLES, np.random.SeedSequence(SEED)).image

    def colored(self, effect: PixelEffect) -> np.ndarray:
        """Return the left image after an effect alone."""
        left, right = decode(self.truth.image), decode(self.truth.right)
        metered = targets(left.mean(axis=(0, 1), dtype=np.float64)[None], self.rig)
        settled = Adaptation(*metered[0].tolist())
        eyes = EyeImages(self.rig.intrinsics, left, right, settled)
        return encode(effect.apply(eyes, self.rig, effect_rng(SEED, 0, effect.name)).left)

    def infrared(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the left infrared image of a rig with the D435's projector, off and on."""
        off = infrared_image(self.truth.image)
        gain, projected = self._projected
        return off, with_dots(off, gain * projected.light)

    def _dots_show(self) -> np.ndarray:
        gain, projected = self._projected
        return stands_out(infrared_image(self.truth.image), gain * projected.peak, self.rig)

    @cached_property
    def _projected(self) -> tuple[np.float32, Projected]:
        """The brightness of the D435's dots, and where they are."""
        figures = load_profile("d435").figures
        camera = still_life_camera(self.rig)
        place = camera.shifted_right(figures["projector_offset"].value).world_from_cam
        gain = np.float32(figures["projector_power"].value * self._renderer.exposure)
        return gain, self._renderer.project_dots(camera, place)

    def drifted(self) -> np.ndarray:
        """Return the right image of a rig whose calibration has drifted."""
        rig = self.rig
        drift = CALIBRATION_DRIFT.draw(rig, SEED, SHOWN_DRIFT)
        believed = still_life_camera(rig).shifted_right(rig.baseline).world_from_cam
        pose = believed @ rigid(drift.believed_from_turned, np.zeros(3))
        camera = Camera(drift.right_intrinsics(rig.intrinsics), pose)
        return self._renderer.render_image(camera, SAMPLES, RIGHT_SEED)[0]


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


def color_strip(before: np.ndarray, after: np.ndarray, path: Path, eye: str = "left") -> None:
    """Draw an image of an eye off and on, and the difference, as one JPEG."""
    difference = after.astype(np.float32) - before
    gain = max(1, round(100 / max(1.0, float(np.percentile(np.abs(difference), 99)))))
    shown = np.clip(128 + gain * difference, 0, 255).astype(np.uint8)
    titles = (f"{eye} image, off", f"{eye} image, on", f"difference x {gain}")
    pictures = zip(titles, (before, after, shown), strict=True)
    draw_panels([(title, pixels, {}) for title, pixels in pictures], path)


def draw_all(studio: SensorStudio, folder: Path) -> None:
    """Draw the strip of every effect into ``folder``."""
    for effect in AFTER_MATCHING:
        if effect.name in WITHOUT_PICTURE:
            continue
        depth_strip(studio.depth_figure(effect), folder / f"{effect.name}.jpg")
    for effect in SECOND_SURFACES:
        studio.surface_strip(effect, folder / f"{effect.name}.jpg")
    tiers_strip(studio, folder / f"{TIERS_PICTURE}.jpg")
    images = {effect.name: studio.shuttered(effect) for effect in (ROLLING_SHUTTER, IMAGE_BLUR)}
    images |= {
        effect.name: studio.colored(effect)
        for effect in PIXEL_EFFECTS
        if effect.name not in WITHOUT_PICTURE
    }
    for name, image in images.items():
        color_strip(studio.truth.image, image, folder / f"{name}.jpg")
    color_strip(*studio.infrared(), folder / f"{PROJECTOR.name}.jpg", "left infrared")
    path = folder / f"{CALIBRATION_DRIFT.name}.jpg"
    color_strip(studio.truth.right, studio.drifted(), path, "right")


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
