"""The effects of the planned tier, one file each, and their physical order."""

from sim.sensor.effects.correlated_noise import CorrelatedNoise
from sim.sensor.effects.depth_range import DepthRange
from sim.sensor.effects.edge_fattening import EdgeFattening
from sim.sensor.effects.exposure import Exposure
from sim.sensor.effects.flying_pixels import FlyingPixels
from sim.sensor.effects.grazing import Grazing
from sim.sensor.effects.invalid_band import InvalidBand
from sim.sensor.effects.mirror import Mirror
from sim.sensor.effects.mis_rectification import MisRectification
from sim.sensor.effects.motion_blur import MotionBlur
from sim.sensor.effects.occlusion import Occlusion
from sim.sensor.effects.protocol import DepthEffect
from sim.sensor.effects.quantum import Quantum
from sim.sensor.effects.random_invalid import RandomInvalid
from sim.sensor.effects.ripple import Ripple
from sim.sensor.effects.specular import Specular
from sim.sensor.effects.static_field import StaticField
from sim.sensor.effects.textureless import Textureless
from sim.sensor.effects.transparency import Transparency
from sim.sensor.effects.weak_texture import WeakTexture

EFFECTS: tuple[DepthEffect, ...] = (
    # What light brings to a pixel: another surface than the one in front.
    Transparency(),
    Mirror(),
    Specular(),
    # What the window compares.
    EdgeFattening(),
    Exposure(),
    Textureless(),
    WeakTexture(),
    Grazing(),
    Occlusion(),
    # How exactly it compares.
    MotionBlur(),
    MisRectification(),
    Ripple(),
    CorrelatedNoise(),
    StaticField(),
    Quantum(),
    # What the device does afterwards.
    FlyingPixels(),
    InvalidBand(),
    DepthRange(),
    RandomInvalid(),
)
