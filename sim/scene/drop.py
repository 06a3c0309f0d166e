"""A pile: objects that fall onto the ground and come to rest, by MuJoCo (an optional package).

Each object is the convex hull of its vertices, with the same density everywhere. They start above each other,
turned at random, and fall through drag, so that those from high up do not hit like bullets. The simulation
scales all objects so that the longest one is `LONGEST`: the steps and limits below then fit both toys and
wardrobes.
"""

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.geometry.rigid import rigid
from digs_warp.sim.scene.load import MeshFile
from digs_warp.sim.scene.mesh.resting import hull_of

_log = logging.getLogger(__name__)

# Length that the longest object has in the simulation [m].
LONGEST = 0.3

STEP = 0.002  # [s]

# Objects start this far from the common axis, as a share of their mean length, and this far apart [m].
SPREAD, GAP = 0.15, 0.01

# Of wood or plastic on wood: sliding (no unit), twisting and rolling [m].
FRICTION = (0.6, 0.005, 0.001)

# Time constant of a contact [s], twice the step as MuJoCo asks for, and its damping ratio. With the stiffness
# near 1, resting bodies sink in by less than a thousandth of their length.
CONTACT, STIFFNESS = (2 * STEP, 1.0), (0.99, 0.999, 1e-3, 0.5, 2.0)

# Share of its speed that a body loses in a second [1/s]: it falls at 2 m/s at most.
DRAG = 5.0

# All bodies rest when none has been faster than this [m/s, rad/s] for so long [s].
REST_SPEED, REST_TURN, REST_TIME = 1e-3, 1e-2, 0.25

# Beyond the time of the fall [s].
LONGEST_SETTLING = 15.0


@dataclass(frozen=True, eq=False)
class Body:
    """The hull of an object around its center of mass, in the simulation's lengths.

    Attributes:
        corners: of the hull [m], shape (k, 3).
        center: of mass, where the object stands alone, in the world's lengths [m], shape (3,).
        radius: largest distance of a corner from the center of mass [m].
    """

    corners: np.ndarray
    center: np.ndarray
    radius: float


def dropped(files: Sequence[MeshFile], rng: np.random.Generator) -> list[np.ndarray]:
    """Return the motion of each object from where it stands alone to where it came to rest, (4, 4).

    The lowest point of all is at z = 0. A warning says when they still move after a long time.

    Args:
        files: the objects.
        rng: source of their turns and places at the start.

    Raises:
        DigsError: MuJoCo is missing, or an object without volume.
    """
    engine = _engine()
    scale = LONGEST / max(each.longest_side for each in files)
    bodies = [_body(each, scale) for each in files]
    poses = _fall(engine, bodies, _starts(bodies, rng))
    lowest = min(
        (body.corners @ pose[:3, :3].T + pose[:3, 3])[:, 2].min()
        for body, pose in zip(bodies, poses, strict=True)
    )
    motions = []
    for body, pose in zip(bodies, poses, strict=True):
        place = (pose[:3, 3] - (0.0, 0.0, lowest)) / scale
        motions.append(rigid(pose[:3, :3], place - pose[:3, :3] @ body.center))
    return motions


def _engine() -> Any:
    try:
        return import_module("mujoco")
    except ImportError as error:
        raise DigsError(
            f"--arrange drop needs MuJoCo ({error}): pip install 'digs-warp[drop]'. Or leave it out: objects "
            "then stand beside each other"
        ) from error


def _body(file: MeshFile, scale: float) -> Body:
    hull = hull_of(file.vertices)
    if hull is None:
        raise DigsError(
            f"--arrange drop: mesh '{file.path}' is flat, so it has no weight; leave it out, or use "
            "--arrange rest"
        )
    corners = (np.unique(hull.corners.reshape(-1, 3), axis=0) - hull.center) * scale
    return Body(corners, hull.center, float(np.linalg.norm(corners, axis=1).max()))


def _starts(bodies: Sequence[Body], rng: np.random.Generator) -> list[np.ndarray]:
    """Return the pose of each body at the start: above each other in a random order, (4, 4)."""
    from scipy.spatial.transform import Rotation

    turns = Rotation.random(len(bodies), rng=rng).as_matrix()
    reach = SPREAD * np.mean([2 * body.radius for body in bodies])
    angles = rng.uniform(0.0, 2.0 * np.pi, len(bodies))
    places = (
        reach
        * np.sqrt(rng.uniform(size=(len(bodies), 1)))
        * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    )
    poses, top = [np.eye(4)] * len(bodies), 0.0
    for i in rng.permutation(len(bodies)):
        height = top + GAP + bodies[i].radius
        poses[i] = rigid(turns[i], np.array([*places[i], height]))
        top = height + bodies[i].radius
    return poses


def _fall(engine: Any, bodies: Sequence[Body], starts: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Return the pose of each body at rest, (4, 4)."""
    model = _model(engine, bodies, starts)
    data = engine.MjData(model)
    highest = max(pose[2, 3] for pose in starts)
    limit = LONGEST_SETTLING + highest * DRAG / -model.opt.gravity[2]
    still = 0.0
    while still < REST_TIME and data.time < limit:
        engine.mj_step(model, data)
        speeds = np.abs(data.qvel.reshape(-1, 6))
        slow = speeds[:, :3].max() < REST_SPEED and speeds[:, 3:].max() < REST_TURN
        still = still + STEP if slow else 0.0
    if still < REST_TIME:
        _log.warning(
            "--arrange drop: the objects still move after %.0f s; they stay where they are then. Another "
            "--seed may let them come to rest",
            data.time,
        )
    return [
        rigid(data.xmat[i].reshape(3, 3), data.xpos[i].copy()) for i in range(1, len(bodies) + 1)
    ]


def _model(engine: Any, bodies: Sequence[Body], starts: Sequence[np.ndarray]) -> Any:
    spec = engine.MjSpec()
    spec.option.timestep = STEP
    spec.option.integrator = engine.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = engine.mjtCone.mjCONE_ELLIPTIC
    touch = {"condim": 6, "friction": FRICTION, "solref": CONTACT, "solimp": STIFFNESS}
    ground = engine.mjtGeom.mjGEOM_PLANE
    spec.worldbody.add_geom(name="ground", type=ground, size=[0, 0, 1], **touch)
    for i, (body, start) in enumerate(zip(bodies, starts, strict=True)):
        name = f"object {i}"
        spec.add_mesh(name=name, uservert=body.corners.ravel())
        turn = np.empty(4)
        engine.mju_mat2Quat(turn, start[:3, :3].ravel())
        part = spec.worldbody.add_body(name=name, pos=start[:3, 3], quat=turn)
        part.add_freejoint()
        part.add_geom(type=engine.mjtGeom.mjGEOM_MESH, meshname=name, **touch)
    model = spec.compile()
    inertia = model.body_inertia[1:].mean(axis=1)
    weights = np.repeat(np.stack([model.body_mass[1:], inertia], axis=1), 3, axis=1)
    model.dof_damping[:] = DRAG * weights.ravel()
    return model
