"""What a recording says about itself: scene, camera and sensor, for its index and its log."""

import math
from dataclasses import asdict, replace
from typing import Any

from digs_warp.data.about import About
from digs_warp.data.objects import PlacedObject, matrix_rows
from digs_warp.data.rig import InfraredPair, Rig
from digs_warp.sim.camera.profiles import Profile
from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.record.sensor_plan import SensorPlan
from digs_warp.sim.record.session import Session
from digs_warp.sim.scene.scene import Scene, SceneObject
from digs_warp.sim.sensor.frame import Cause


def facts_about(session: Session, plan: SensorPlan) -> About:
    """Return the facts about the recording for its index."""
    config = session.config
    objects = session.scene.objects
    is_one_file = len(objects) == 1 and objects[0].mesh is not None
    about = About(
        tier=config.tier,
        seed=config.seed,
        object_radius=session.scene.object_radius,
        world_from_mesh=matrix_rows(objects[0].world_from_mesh) if is_one_file else None,
        objects=tuple(map(_placed, objects)),
        surround_radius=session.environment.radius,
        ground=session.ground,
        exposure=session.renderer.exposure,
        sensor={k: _plain(v) for k, v in asdict(session.rig).items() if k != "intrinsics"},
    )
    if not config.plans_effects:
        return about
    return replace(
        about,
        sensor={
            **(about.sensor or {}),
            "drift": asdict(plan.drift(session.rig, config.seed, config.strength)),
        },
        readout_time=plan.shutter(session.rig, config.strength).readout_time,
        effects=plan.effects_on,
        cause_labels={cause.value: cause.name.lower() for cause in Cause},
    )


def _placed(each: SceneObject) -> PlacedObject:
    mesh = None if each.mesh is None else str(each.mesh)
    width, depth, height = (float(side) for side in each.size)
    return PlacedObject(each.name, (width, depth, height), matrix_rows(each.world_from_mesh), mesh)


def rig_record(rig: StereoRig) -> Rig:
    """Return where the eyes are beside the camera that takes the images, as a capture holds it."""
    if not rig.has_color_camera:
        return Rig(rig.baseline)
    k = rig.intrinsics
    return Rig(rig.baseline, InfraredPair(-rig.color_offset, k.fx, k.fy, k.cx, k.cy))


def object_record(scene: Scene) -> dict[str, Any]:
    """Return the size of all objects [m] along x, y and z; of one, also what was assumed about its file."""
    placement = scene.objects[0].placement if len(scene.objects) == 1 else None
    assumed = {}
    if placement is not None:
        assumed = {
            "up": placement.up,
            "scale": placement.scale.origin,
            "turned_deg": placement.turned,
        }
    return {"size": scene.size.tolist(), **assumed}


def profile_record(profile: Profile) -> dict[str, Any]:
    """Return the camera model with the origin of every figure."""
    figures = {
        name: {**asdict(figure), "value": _plain(figure.value)}
        for name, figure in profile.figures.items()
    }
    return {"name": profile.name, "title": profile.title, "figures": figures}


def _plain(value: Any) -> Any:
    """Return the value, or None for an infinite one, which JSON cannot say."""
    return None if isinstance(value, float) and not math.isfinite(value) else value
