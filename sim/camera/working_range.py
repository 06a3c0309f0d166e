"""From how far away a camera records an object, and whether it can measure it from there."""

import logging

from digs_warp.checks import DigsError
from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.camera.walk.hand_motion import distance_limits
from digs_warp.sim.camera.walk.paths import fitting_distance
from digs_warp.sim.camera.walk.settings import WalkSettings
from digs_warp.sim.scene.scene import Scene

_log = logging.getLogger(__name__)

# Margin between the object and the nearest depth that the sensor reports, in radii of the object.
NEAR_MARGIN = 1.2

# An object this many times farther away than where it would fill the image is worth a warning: it has less
# than half of the pixels that it could have.
LOST_PIXELS = 1.6

# The camera stays this many radii away from the middle of the objects.
LEAST_RADII = 1.05


def camera_distance(scene: Scene, rig: StereoRig, walk: WalkSettings) -> float:
    """Return the distance [m] of a walk without its wander: as asked for, or where fit and range say.

    Raises:
        DigsError: the camera would run into the object.
    """
    radius = scene.object_radius
    distance = walk.distance
    if distance is None:
        distance = walk.distance_factor * _usual_distance(scene, rig, walk)
    nearest, _ = distance_limits(walk.unsteadiness)
    if nearest * distance < LEAST_RADII * radius:
        flag = "--camera-distance" if walk.distance is not None else "distance_factor"
        raise DigsError(
            f"{flag}: {distance:.3g} m from the middle of the objects, which reach out to {radius:.3g} m: "
            f"the camera would run into them; choose {LEAST_RADII * radius / nearest:.3g} m or more"
        )
    return distance


def check_reach(scene: Scene, rig: StereoRig, walk: WalkSettings) -> None:
    """Warn if the camera measures the object poorly because of its size.

    Raises:
        DigsError: the camera would run into the object, or even the object's nearest point is farther away
            than the camera measures.
    """
    distance, k = camera_distance(scene, rig, walk), rig.image_intrinsics
    longest = scene.size.max()
    size = f"{longest:.3g} m" if longest >= 1 else f"{100 * longest:.3g} cm"
    where = f"object of {size}: is recorded from {distance:.3g} m away"
    measured = f"this camera measures {rig.min_depth:g} to {rig.max_depth:g} m"
    if distance - scene.object_radius >= rig.max_depth:
        raise DigsError(f"{where}, but {measured}. {_hint(scene)}")
    if not rig.min_depth <= distance <= rig.max_depth:
        part = "far" if distance < rig.min_depth else "near"
        _log.warning("%s, but %s; only its %s parts get depth", where, measured, part)
    filling = fitting_distance(scene.object_radius, k, shake=0, unsteadiness=0)
    is_chosen = walk.distance is not None or walk.distance_factor != 1
    if not is_chosen and distance > LOST_PIXELS * filling:
        _log.warning(
            "%s, where it spans %.0f of %d x %d px: nearer, the camera would not measure it (%s), or not see "
            "it with both eyes. Use more pixels (--width) or another --profile, or scale it (--object-size)",
            *(where, k.fx * longest / distance, k.width, k.height, measured),
        )


def _usual_distance(scene: Scene, rig: StereoRig, walk: WalkSettings) -> float:
    """Return the distance [m] from which the object fits the image and is in reach of the camera.

    An object that would be out of reach is seen from nearer, where it is larger than the image, if there is
    room between it and the camera.
    """
    nearest, _ = distance_limits(walk.unsteadiness)
    k, baseline = rig.image_intrinsics, rig.image_baseline
    seen = fitting_distance(scene.object_radius, k, walk.shake, walk.unsteadiness, baseline)
    measurable = (rig.min_depth + NEAR_MARGIN * scene.object_radius) / nearest
    fitting = max(seen, measurable)
    is_out_of_reach = fitting - scene.object_radius >= rig.max_depth
    has_room = nearest * rig.max_depth >= LEAST_RADII * scene.object_radius
    return rig.max_depth if is_out_of_reach and has_room else fitting


def _hint(scene: Scene) -> str:
    """Say what to do about an object that is too large."""
    largest = max(scene.objects, key=lambda each: each.size.max(), default=None)
    if largest is None or largest.placement is None:
        return "Choose another camera with --profile"
    return (
        f"Size of the file: {largest.placement.scale.origin}. Is that right? --mesh-unit or --object-size "
        "say otherwise; or choose a camera that sees wider or farther with --profile, or come nearer "
        "with --camera-distance"
    )
