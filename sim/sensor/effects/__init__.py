"""The effects on depth, one file each: second surfaces for the search, then what acts on its result.

Whatever the images show is not here: the search errs on them by itself. To add an effect: write its file
(`protocol.py`), and add a line to SECOND_SURFACES or AFTER_MATCHING. CONTRIBUTING.md has the rest.
"""

from digs_warp.sim.sensor.effects.disparity_errors import (
    Quantum,
    Rejection,
    Smoothing,
    Speckle,
    StaticField,
)
from digs_warp.sim.sensor.effects.protocol import DepthEffect, Effect
from digs_warp.sim.sensor.effects.second_surfaces import Mirror, Transparency

# Surfaces behind or in front of the first one, which the images show, too.
SECOND_SURFACES: tuple[Effect, ...] = (Transparency(), Mirror())
SECOND_SURFACE_NAMES = frozenset(effect.name for effect in SECOND_SURFACES)

# What no image shows, in the order in which it acts: what the device makes of its matches, the error of the
# lenses, then how disparity is reported.
AFTER_MATCHING: tuple[DepthEffect, ...] = (
    Rejection(),
    Smoothing(),
    Speckle(),
    StaticField(),
    Quantum(),
)

EFFECTS: tuple[Effect, ...] = (*SECOND_SURFACES, *AFTER_MATCHING)
