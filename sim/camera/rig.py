"""The stereo camera: two rectified eyes side by side, and the parameters of its depth sensor."""

from dataclasses import dataclass, fields, replace

import numpy as np

from digs_warp.checks import DigsError, check_positive
from digs_warp.geometry.camera import Intrinsics

# Of smooth noise [px]; smaller ones cannot be told from white noise.
SHORTEST_CORRELATION = 1.5


@dataclass(frozen=True, kw_only=True)
class StereoRig:
    """Two equal cameras with parallel axes; the right one is ``baseline`` metres to the right.

    The first ten fields are for geometry and the closed-form law; the others for the effects on depth and
    images. ``digs_warp.sim.camera.profiles`` has them for real cameras, with sources.

    Attributes:
        intrinsics: of either eye.
        baseline: [m].
        disparity_sigma: standard deviation of the disparity noise [px], for the tier "law" as the next five;
            matching makes its own, but what laser speckle changes from frame to frame.
        disparity_correlation: distance at which its coarsest part has fallen to 1/e [px], >= 1.5; 0: white.
        temporal_share: of its variance, what changes from frame to frame, 0 to 1.
        disparity_distortion: constant error of the disparity, relative; with that, noise falls with distance.
        hole_share: of a plain surface, what has no depth, 0 to 1; 0: no holes at all, nor shadows.
        disparity_step: step in which disparity is reported [px]; 0: none.
        min_depth: nearest depth that is reported [m].
        max_depth: farthest depth that is reported [m].
        max_disparity: end of the search range [px]; 0: as far as the nearest depth requires.
        window: width of the matching window [px].
        smoothness: factor on the penalties of the search for disparities that change; 1: OpenCV's suggestion.
        least_confidence: matches with less are dropped by the device, 0 to 1; 0: none.
        smoothing: weight of the neighbors in the device's average of matches along rows and columns, 0 (none)
            to 1; steps stay.
        lasting_speckle: standard deviation of the laser's speckle that stays on the surface [px], where
            matching makes the noise.
        static_field: standard deviation of the smooth, constant error of a unit [px].
        unit: number of the unit; each has a different static field.
        rotation_drift: standard deviation of each of the three angles by which the right eye has turned since
            the calibration [degree].
        focal_drift: standard deviation of the change of the right eye's focal length, relative.
        baseline_drift: standard deviation of the change of the baseline, relative.
        image_noise: noise of each color channel of a mid-gray pixel [DN of 255].
        full_well: electrons of a white pixel at the gain in use; determines how noise grows with light.
        exposure_time: at the common exposure of the recording [s].
        exposure_headroom: how much longer the camera can expose before it has to amplify [stops].
        exposure_lag: time constant of the automatic exposure [s].
        white_balance: share of a color cast that the automatic white balance removes, 0 to 1.
        white_balance_lag: its time constant [s].
        readout_time: from the first to the last row of a rolling shutter [s]; 0: global shutter.
        vignetting: light lost in the corners, 0 to 1.
        lens_blur: standard deviation of the point spread of the eyes' lenses [px]; that of projected dots is
            in their pattern.
        projector_power: brightness of a projected dot on a white matte wall at 1 m, in the unit of the
            environment's radiance, where usual panoramas have a mean of about 0.7; 0: no projector.
        projector_offset: place of the projector along the baseline, from the left eye [m].
        color_offset: place of the color camera along the baseline, from the left eye [m].
        color_zoom: focal length of the color camera over that of the eyes.
        color_noise: what ``image_noise`` is for the eyes, for the color camera.
        color_blur: the same of ``lens_blur``.
    """

    intrinsics: Intrinsics
    baseline: float
    disparity_sigma: float
    disparity_step: float
    min_depth: float
    max_depth: float
    disparity_correlation: float = 0.0
    temporal_share: float = 1.0
    disparity_distortion: float = 0.0
    hole_share: float = 0.0
    max_disparity: float = 0.0
    window: int = 5
    smoothness: float = 1.0
    least_confidence: float = 0.0
    smoothing: float = 0.0
    lasting_speckle: float = 0.0
    static_field: float = 0.1
    unit: int = 0
    rotation_drift: float = 0.0
    focal_drift: float = 0.0
    baseline_drift: float = 0.0
    image_noise: float = 2.0
    full_well: float = 4_400.0
    exposure_time: float = 0.01
    exposure_headroom: float = 1.0
    exposure_lag: float = 0.3
    white_balance: float = 0.5
    white_balance_lag: float = 1.3
    readout_time: float = 0.0
    vignetting: float = 0.3
    lens_blur: float = 0.0
    projector_power: float = 0.0
    projector_offset: float = 0.0
    color_offset: float = 0.0
    color_zoom: float = 1.0
    color_noise: float = 0.0
    color_blur: float = 0.0

    def __post_init__(self) -> None:
        check_positive("rig: baseline [m]", self.baseline)
        check_positive("rig: full_well [electrons]", self.full_well)
        for name in _AMOUNTS:
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0):
                raise DigsError(f"rig: {name}={value}, expected a finite number >= 0")
        if 0 < self.disparity_correlation < SHORTEST_CORRELATION:
            raise DigsError(
                f"rig: disparity_correlation={self.disparity_correlation}, expected 0 (white noise) or "
                f"{SHORTEST_CORRELATION} px and more"
            )
        for name in _SHARES:
            if getattr(self, name) > 1:
                raise DigsError(f"rig: {name}={getattr(self, name)}, expected a share from 0 to 1")
        check_positive("rig: color_zoom", self.color_zoom)
        for name in ("projector_offset", "color_offset"):
            if not np.isfinite(getattr(self, name)):
                raise DigsError(f"rig: {name}={getattr(self, name)}, expected a number of metres")
        if self.window < 1 or self.window % 2 == 0:
            raise DigsError(f"rig: window={self.window}, expected an odd number of pixels >= 1")
        if self.unit < 0:
            raise DigsError(f"rig: unit={self.unit}, expected 0 or more")
        if not 0 < self.min_depth < self.max_depth:
            raise DigsError(
                f"rig: depth range {self.min_depth} to {self.max_depth} m, expected 0 < min < max"
            )

    @property
    def focal_baseline(self) -> float:
        """Focal length times baseline [px m]: disparity = focal_baseline / depth."""
        return self.intrinsics.fx * self.baseline

    @property
    def changing_sigma(self) -> float:
        """Standard deviation of the noise that changes from frame to frame [px]."""
        return float(np.sqrt(self.temporal_share)) * self.disparity_sigma

    @property
    def speckle(self) -> float:
        """Standard deviation of the noise that only a projector makes [px]."""
        own = float(np.hypot(self.changing_sigma, self.lasting_speckle))
        return own if self.projector_power > 0 else 0.0

    @property
    def has_color_camera(self) -> bool:
        """Whether a separate color camera takes the images, and an infrared pair measures depth.

        Otherwise the left eye takes the images.
        """
        return self.projector_power > 0 or self.color_offset != 0 or self.color_zoom != 1

    @property
    def image_intrinsics(self) -> Intrinsics:
        """Of the camera that takes the images, to which depth is registered; its size is that of the eyes."""
        k = self.intrinsics
        return replace(k, fx=k.fx * self.color_zoom, fy=k.fy * self.color_zoom)

    @property
    def image_baseline(self) -> float:
        """Distance of the right eye from the camera that takes the images [m]; 0: there is no right image."""
        return 0.0 if self.has_color_camera else self.baseline

    @property
    def largest_disparity(self) -> float:
        """Disparity of the nearest depth that the sensor can report [px]."""
        nearest = self.focal_baseline / self.min_depth
        return min(nearest, self.max_disparity) if self.max_disparity > 0 else nearest


_SHARES = (
    *("vignetting", "white_balance", "temporal_share", "hole_share", "least_confidence"),
    "smoothing",
)
# Checked one by one; all others are finite numbers from 0.
_OTHERS = {
    *("intrinsics", "baseline", "min_depth", "max_depth", "window", "unit", "full_well"),
    *("color_zoom", "projector_offset", "color_offset"),
}
_AMOUNTS = tuple(each.name for each in fields(StereoRig) if each.name not in _OTHERS)
