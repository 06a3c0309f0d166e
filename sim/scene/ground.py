"""What the object stands on: a floor, which is part of the surround, or a table on it."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from digs_warp.sim.scene.environment import Environment
from digs_warp.sim.scene.join import join_scenes
from digs_warp.sim.scene.scene import Scene

Ground = Literal["auto", "floor", "table", "none"]

# Smallest radius of the dome over a floor, and half the width of the built-in room [m].
DOME_RADIUS = 6.0
ROOM_HALF_WIDTH = 2.0

# The walls are at least this many times as far away as the camera.
SURROUND_MARGIN = 1.75

# Height of a table [m], and the longest side of what is put on one rather than on the floor.
TABLE_HEIGHT = 0.75
TABLE_THINGS = 0.55

# Largest spread of several objects on a table [m].
TABLE_SPREAD = 1.5


@dataclass(frozen=True, eq=False)
class Setting:
    """Objects with what they stand on, and what is around them; ``ground`` is never "auto"."""

    scene: Scene
    environment: Environment
    ground: Ground


def set_up(scene: Scene, environment: Environment, ground: Ground, farthest: float) -> Setting:
    """Return the objects on their ground, in a surround that is large enough for a walk.

    Args:
        scene: the objects.
        environment: as it was loaded.
        ground: "auto": a table for small objects, a floor for large ones and in the built-in room, which has
            one; "none": a sphere around the objects.
        farthest: distance of the camera from the origin, at most [m].
    """
    beyond = SURROUND_MARGIN * farthest
    if ground == "none":
        wide = replace(environment, radius=max(environment.radius, beyond))
        return Setting(scene, wide, ground)
    if ground == "auto":
        ground = "table" if _fit_a_table(scene) and not environment.is_room else "floor"
    least = ROOM_HALF_WIDTH if environment.is_room else DOME_RADIUS
    things = np.stack([scene.vertices.min(axis=0), scene.vertices.max(axis=0)])
    floor = top = float(scene.object_vertices[:, 2].min())
    if ground == "table":
        from digs_warp.sim.scene.table import table_scene

        floor = top - TABLE_HEIGHT
        scene = join_scenes(scene, table_scene(top, floor, things.astype(np.float64)))
    return Setting(scene, replace(environment, radius=max(least, beyond), floor=floor), ground)


def _fit_a_table(scene: Scene) -> bool:
    """Whether people would put the objects on a table."""
    largest = max((float(each.size.max()) for each in scene.objects), default=scene.size.max())
    return bool(largest <= TABLE_THINGS and scene.size.max() <= TABLE_SPREAD)
