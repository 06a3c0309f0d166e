"""The effects of the planned tier, one file each, and their physical order.

To add one: write its file (`protocol.DepthEffect`), and add a line to EFFECTS. CONTRIBUTING.md has the rest.
"""

from digs_warp.sim.sensor.effects.correlated_noise import CorrelatedNoise
from digs_warp.sim.sensor.effects.depth_range import DepthRange
from digs_warp.sim.sensor.effects.edge_fattening import EdgeFattening
from digs_warp.sim.sensor.effects.exposure import Exposure
from digs_warp.sim.sensor.effects.flying_pixels import FlyingPixels
from digs_warp.sim.sensor.effects.grazing import Grazing
from digs_warp.sim.sensor.effects.invalid_band import InvalidBand
from digs_warp.sim.sensor.effects.mirror import Mirror
from digs_warp.sim.sensor.effects.motion_blur import MotionBlur
from digs_warp.sim.sensor.effects.occlusion import Occlusion
from digs_warp.sim.sensor.effects.protocol import DepthEffect
from digs_warp.sim.sensor.effects.quantum import Quantum
from digs_warp.sim.sensor.effects.random_invalid import RandomInvalid
from digs_warp.sim.sensor.effects.ripple import Ripple
from digs_warp.sim.sensor.effects.specular import Specular
from digs_warp.sim.sensor.effects.static_field import StaticField
from digs_warp.sim.sensor.effects.textureless import Textureless
from digs_warp.sim.sensor.effects.transparency import Transparency
from digs_warp.sim.sensor.effects.weak_texture import WeakTexture

EFFECTS: tuple[DepthEffect, ...] = (
    # What a pixel shows: not always the surface in front.
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
    # How precisely it compares.
    MotionBlur(),
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

# What no image shows: errors of the calibration, and what the device does after matching. They act on
# measurements by the tier "guided", too.
AFTER_MATCHING = frozenset((StaticField.name, FlyingPixels.name))
