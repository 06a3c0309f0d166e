"""Effects on the colour path, one file each, in the order in which light meets them."""

from sim.sensor.color.auto_exposure import AutoExposure
from sim.sensor.color.image_blur import ImageBlur
from sim.sensor.color.protocol import ColorEffect, PixelEffect
from sim.sensor.color.read_noise import ReadNoise
from sim.sensor.color.rolling_shutter import RollingShutter
from sim.sensor.color.shot_noise import ShotNoise
from sim.sensor.color.vignetting import Vignetting

ROLLING_SHUTTER = RollingShutter()
IMAGE_BLUR = ImageBlur()

# Applied to the finished images; the two above shape how the images are rendered.
PIXEL_EFFECTS: tuple[PixelEffect, ...] = (Vignetting(), AutoExposure(), ShotNoise(), ReadNoise())

COLOR_EFFECTS: tuple[ColorEffect, ...] = (ROLLING_SHUTTER, IMAGE_BLUR, *PIXEL_EFFECTS)
