"""Effects on the images, in the order in which light meets them; see CONTRIBUTING.md to add one."""

from digs_warp.sim.sensor.color.auto_exposure import AutoExposure, WhiteBalance
from digs_warp.sim.sensor.color.image_noise import ReadNoise, ShotNoise
from digs_warp.sim.sensor.color.protocol import PixelEffect
from digs_warp.sim.sensor.color.rendering import (
    CalibrationDrift,
    ImageBlur,
    Projector,
    RollingShutter,
)
from digs_warp.sim.sensor.color.vignetting import LensBlur, Vignetting
from digs_warp.sim.sensor.effects.protocol import Effect

PROJECTOR = Projector()
ROLLING_SHUTTER = RollingShutter()
IMAGE_BLUR = ImageBlur()
CALIBRATION_DRIFT = CalibrationDrift()

# Applied to the finished images; the three above change how the images are rendered.
AUTO_EXPOSURE = AutoExposure()
WHITE_BALANCE = WhiteBalance()
LENS_BLUR = LensBlur()
PIXEL_EFFECTS: tuple[PixelEffect, ...] = (
    LENS_BLUR,
    Vignetting(),
    AUTO_EXPOSURE,
    WHITE_BALANCE,
    ShotNoise(),
    ReadNoise(),
)

COLOR_EFFECTS: tuple[Effect, ...] = (
    PROJECTOR,
    ROLLING_SHUTTER,
    IMAGE_BLUR,
    CALIBRATION_DRIFT,
    *PIXEL_EFFECTS,
)
