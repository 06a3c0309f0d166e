"""Loads what the settings of a recording name: object, surround and camera."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.sim.camera.profiles import DEFAULT_PROFILE, DEFAULT_SIZE, Profile, load_profile
from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.camera.working_range import check_reach
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.scene.appearance import refinished, relit
from digs_warp.sim.scene.builtin import builtin_environment, builtin_scene
from digs_warp.sim.scene.environment import Environment, load_environment
from digs_warp.sim.scene.scene import Scene


@dataclass(frozen=True, eq=False)
class Inputs:
    """What the settings name: everything that can fail because of a wrong path or value."""

    scene: Scene
    environment: Environment
    profile: Profile
    rig: StereoRig


def load_inputs(config: SimulateConfig) -> Inputs:
    """Return object, surround and camera.

    Raises:
        DigsError: a wrong path or figure, an object that is too large for the camera, or no OpenGL where the
            settings ask for it.
    """
    if config.renderer == "gl":
        from digs_warp.sim.render.gl import check_opengl

        check_opengl()
    profile = load_profile(config.profile or DEFAULT_PROFILE)
    rig = rig_of(config)
    with ThreadPoolExecutor(1, thread_name_prefix="environment") as beside:
        loading = beside.submit(_load_environment, config)
        scene = _load_object(config)
        if config.object_turn % 360:
            scene = scene.turned(np.deg2rad(config.object_turn))
        check_reach(scene, rig, config.walk)
        environment = loading.result()
    return Inputs(refinished(scene, config.look), environment, profile, rig)


def _load_environment(config: SimulateConfig) -> Environment:
    if config.environment is None:
        environment = builtin_environment()
    else:
        environment = load_environment(config.environment)
    return relit(environment, config.look, environment.is_room)


def _load_object(config: SimulateConfig) -> Scene:
    size, up, unit = config.object_size, config.up, config.unit
    if config.mesh is not None:
        from digs_warp.sim.scene.load import load_scene

        return load_scene(config.mesh, size, up, unit)
    if config.scene:
        from digs_warp.sim.scene.arrange import load_objects

        return load_objects(config.scene, config.seed, size, up, unit)
    if config.object_size is not None or (config.up, config.unit) != ("auto", "auto"):
        raise DigsError(
            "--object-size, --mesh-unit and --mesh-up tell how to read a mesh file; the built-in object has "
            "none. Leave them out, or name a mesh with --mesh"
        )
    return builtin_scene()


def rig_of(config: SimulateConfig) -> StereoRig:
    """Return the camera at the image size that the settings name."""
    if config.profile is not None:
        return load_profile(config.profile).rig(config.width, config.height)
    width = config.width or DEFAULT_SIZE[0]
    height = config.height or max(1, round(width * DEFAULT_SIZE[1] / DEFAULT_SIZE[0]))
    return load_profile(DEFAULT_PROFILE).rig(width, height)
