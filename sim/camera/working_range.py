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
    distance = camera_distance(scene, rig, walk)
    is_chosen = walk.distance is not None or walk.distance_factor != 1
    how = "is recorded from" if is_chosen else "fits the image from"
    measured = f"this camera measures {rig.min_depth:g} to {rig.max_depth:g} m"
    size = _length(scene.size.max())
    if distance - scene.object_radius >= rig.max_depth:
        raise DigsError(
            f"object of {size}: {how} {distance:.3g} m away, but {measured}. {_hint(scene)}"
        )
    if distance > rig.max_depth:
        _log.warning(
            "object of %s: %s %.3g m away, but %s; only its near parts get depth. %s",
            *(size, how, distance, measured, _hint(scene)),
        )
    if walk.distance is None and distance < _fitting(scene, rig, walk) * walk.distance_factor:
        _log.warning(
            "object of %s: is recorded from %.3g m away, where it is larger than the image, because %s. %s",
            *(size, distance, measured, _hint(scene)),
        )
    if distance < rig.min_depth:
        _log.warning(
            "object of %s: %s %.3g m away, but %s; only its far parts get depth. "
            "Choose another --camera-distance",
            *(size, how, distance, measured),
        )
    filling = fitting_distance(scene.object_radius, rig.image_intrinsics, shake=0, unsteadiness=0)
    if not is_chosen and distance > LOST_PIXELS * filling:
        k = rig.image_intrinsics
        limit, other = _limit(scene, rig, walk)
        _log.warning(
            "%s; an object of %s spans %.0f of %d x %d px. Use more pixels (--width) or a camera %s "
            "(--profile), or scale the object (--object-size)",
            *(limit, size, k.fx * scene.size.max() / distance, k.width, k.height, other),
        )


def _usual_distance(scene: Scene, rig: StereoRig, walk: WalkSettings) -> float:
    """Return the distance [m] from which the object fits the image and is in reach of the camera.

    An object that would be out of reach is seen from nearer, where it is larger than the image, if there is
    room between it and the camera.
    """
    fitting = max(_fitting(scene, rig, walk), _measurable(scene, rig, walk))
    nearest, _ = distance_limits(walk.unsteadiness)
    is_out_of_reach = fitting - scene.object_radius >= rig.max_depth
    has_room = nearest * rig.max_depth >= LEAST_RADII * scene.object_radius
    return rig.max_depth if is_out_of_reach and has_room else fitting


def _fitting(scene: Scene, rig: StereoRig, walk: WalkSettings) -> float:
    """Return the distance [m] from which the object stays in the images."""
    k, baseline = rig.image_intrinsics, rig.image_baseline
    return fitting_distance(scene.object_radius, k, walk.shake, walk.unsteadiness, baseline)


def _limit(scene: Scene, rig: StereoRig, walk: WalkSettings) -> tuple[str, str]:
    """Return what keeps the camera away from the object, and which camera would come nearer."""
    fitting = _fitting(scene, rig, walk)
    if fitting <= _measurable(scene, rig, walk):
        return f"nearest depth of this camera is {rig.min_depth:g} m", "that measures nearer"
    both = f"both eyes of this camera see the object only from {fitting:.3g} m away"
    return both, "whose eyes are closer together"


def _measurable(scene: Scene, rig: StereoRig, walk: WalkSettings) -> float:
    """Return the distance [m] at which no part of the object is too near for the sensor."""
    nearest, _ = distance_limits(walk.unsteadiness)
    return (rig.min_depth + NEAR_MARGIN * scene.object_radius) / nearest


def _hint(scene: Scene) -> str:
    """Say what to do about an object that is too large."""
    placement = (
        max(scene.objects, key=lambda each: each.size.max()).placement if scene.objects else None
    )
    if placement is None:
        return "Choose another camera with --profile"
    return (
        f"Size of the file: {placement.scale.origin}. Is that right? --mesh-unit or --object-size say "
        "otherwise; or choose a camera that sees wider or farther with --profile, or come nearer "
        "with --camera-distance"
    )


def _length(metres: float) -> str:
    return f"{metres:.3g} m" if metres >= 1 else f"{100 * metres:.3g} cm"
