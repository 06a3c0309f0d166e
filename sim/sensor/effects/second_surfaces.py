"""Mirrors and glass: the images show another surface; the search has to try its disparity, too."""

from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.sensor.effects.protocol import Effect
from digs_warp.sim.sensor.facts import SceneFacts


class SecondSurface(Effect):
    """A surface that the images show instead of the first one; ``rays``: to it [ms/MP of its pixels]."""

    of_pixels = True
    rays: float

    def price(self, facts: SceneFacts, rig: StereoRig) -> float:
        """Return the cost of the rays."""
        return self.rays * self.measured(facts, rig)


class Transparency(SecondSurface):
    """Glass: the search tries the surface behind it, too, and the images decide which one is matched."""

    name = "transparency"
    statistic = "transparent_share"
    rays = 400.0
    on = "something transparent is in view: the background behind it may be matched"
    off = "nothing transparent in view"


class Mirror(SecondSurface):
    """Smooth metal: the search tries the reflected scene, too, and the images decide what is matched."""

    name = "mirror"
    statistic = "mirror_share"
    rays = 600.0
    on = "smooth metal reflects the scene: the reflection may be matched, not the surface"
    off = "no smooth metal in view"
