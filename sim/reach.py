"""From how far away a camera records an object, and whether it can measure it from there."""

import logging

from digs_warp.checks import DigsError
from digs_warp.sim.rig import StereoRig
from digs_warp.sim.scene import Scene
from digs_warp.sim.trajectory import fitting_distance

_log = logging.getLogger(__name__)

# Margin between the object and the nearest depth that the sensor reports, in radii of the object.
NEAR_MARGIN = 1.2

# An object this many times farther away than where it would fill the image is worth a warning: it has less
# than half of the pixels that it could have.
LOST_PIXELS = 1.5


def orbit_distance(scene: Scene, rig: StereoRig) -> float:
    """Return the distance [m] at which the object fits the image and no part is too near for the sensor."""
    radius = scene.object_radius
    fitting = fitting_distance(radius, rig.image_intrinsics)
    return max(fitting, rig.min_depth + NEAR_MARGIN * radius)


def check_reach(scene: Scene, rig: StereoRig) -> None:
    """Warn if the camera measures the object poorly because of its size.

    Raises:
        DigsError: even the nearest point of the object is farther away than the camera measures.
    """
    distance = orbit_distance(scene, rig)
    measured = f"this camera measures {rig.min_depth:g} to {rig.max_depth:g} m"
    size = _length(scene.size.max())
    if distance - scene.object_radius >= rig.max_depth:
        raise DigsError(
            f"object of {size}: fits the image from {distance:.3g} m away, but {measured}. {_hint(scene)}"
        )
    if distance > rig.max_depth:
        _log.warning(
            "object of %s: fits the image from %.3g m away, but %s; only its near parts get depth. %s",
            size,
            distance,
            measured,
            _hint(scene),
        )
    if distance > LOST_PIXELS * fitting_distance(scene.object_radius, rig.image_intrinsics):
        k = rig.image_intrinsics
        _log.warning(
            "nearest depth of this camera is %g m; an object of %s spans %.0f of %d x %d px. Use more pixels "
            "(--width) or a camera that measures nearer (--profile), or scale the object (--object-size)",
            rig.min_depth,
            size,
            k.fx * scene.size.max() / distance,
            k.width,
            k.height,
        )


def _hint(scene: Scene) -> str:
    """Say what to do about an object that is too large."""
    placement = (
        max(scene.objects, key=lambda each: each.size.max()).placement if scene.objects else None
    )
    if placement is None:
        return "Choose another camera with --profile"
    return (
        f"Size of the file: {placement.scale.origin}. Is that right? --unit or --object-size say "
        "otherwise; or choose a camera that sees wider or farther with --profile"
    )


def _length(metres: float) -> str:
    return f"{metres:.3g} m" if metres >= 1 else f"{100 * metres:.3g} cm"
