"""Scenes for the tests of the splat engine: random ones, and the hard cases by name."""

from dataclasses import dataclass, replace

import numpy as np

from digs_warp.data.gaussians import Gaussians
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at
from digs_warp.splat.backend import CooperativeBackend, RasterBackend, VectorizedBackend
from digs_warp.splat.camera_motion import STILL, RowMotion

BACKGROUND = np.array([0.2, 0.5, 0.9])
NEAR = 0.05


@dataclass(frozen=True, eq=False)
class SplatScene:
    gaussians: Gaussians
    camera: Camera
    near: float = NEAR
    rows: RowMotion = STILL


def camera(width: int = 41, height: int = 37, **intrinsics: float) -> Camera:
    """A camera 0.7 m from the origin; off-center, and no multiple of the tile size, by default."""
    k = {"fx": 40.0, "fy": 38.0, "cx": 0.56 * width, "cy": 0.41 * height} | intrinsics
    pose = look_at(np.array([0.6, 0.2, 0.3]), np.zeros(3), np.array([0.0, 0.0, 1.0]))
    return Camera(Intrinsics(width, height, k["fx"], k["fy"], k["cx"], k["cy"]), pose)


def random_gaussians(count: int, seed: int, degree: int = 1) -> Gaussians:
    rng = np.random.default_rng(seed)
    return Gaussians(
        means=rng.normal(size=(count, 3)) * 0.15,
        log_scales=np.log(rng.uniform(0.01, 0.06, (count, 3))),
        quats=rng.normal(size=(count, 4)),
        opacity_logits=rng.normal(size=count) * 2,
        sh=rng.normal(size=(count, (degree + 1) ** 2, 3)) * 0.5,
    )


def random_scene(seed: int, count: int = 16) -> SplatScene:
    return SplatScene(random_gaussians(count, seed, degree=seed % 4), camera())


def rolling_scene(seed: int) -> SplatScene:
    """A camera that turns by a fifth of a radian and moves by centimetres while its rows are read."""
    rng = np.random.default_rng([seed, 1])
    rows = RowMotion(rng.normal(size=3) * 0.12, rng.normal(size=3) * 0.05)
    return replace(random_scene(seed), rows=rows)


def hard_cases() -> dict[str, SplatScene]:
    """The hard cases; every one must render like the twin, with finite gradients."""
    some = random_gaussians(6, seed=7)
    view = camera()
    forward = view.world_from_cam[:3, 2]

    def with_first(**changes: np.ndarray | float) -> Gaussians:
        """Some Gaussians, the first of which is another."""
        arrays = {name: getattr(some, name).copy() for name in changes}
        for name, value in changes.items():
            arrays[name][0] = value
        return replace(some, **arrays)

    def at_depth(depth: float, **changes: float) -> Gaussians:
        """The first sits at a depth on the optical axis."""
        return with_first(means=view.center_world + depth * forward, **changes)

    # A center outside the image and its margin, where the tangents are clamped, and wide enough to be seen.
    aside = view.center_world + 0.3 * forward + 0.45 * view.world_from_cam[:3, 0]
    # 20 opaque Gaussians behind one another: pixels stop after three.
    opaque = replace(
        random_gaussians(20, seed=5, degree=0),
        means=(np.linspace(-0.2, 0.2, 20)[:, None] * forward).astype(np.float32),
        opacity_logits=np.full(20, 20.0, np.float32),
    )
    logits = np.concatenate([[60.0, -60.0, 12.0], some.opacity_logits[3:]])
    gaussians = {
        "needles of 10,000 to 1": replace(some, log_scales=np.log([[0.3, 3e-5, 3e-5]] * 6)),
        "points": replace(some, log_scales=np.full((6, 3), np.log(1e-12))),
        # Half of a splat's extent lies before the near plane, half behind it.
        "straddles the near plane": at_depth(NEAR * 1.5, log_scales=np.log(0.04)),
        "no Gaussian": random_gaussians(0, seed=0),
        "behind the camera": at_depth(-0.3),
        "just before the near plane": at_depth(NEAR * 1.001),
        "covers the whole image": with_first(log_scales=np.log(2.0)),
        "zero quaternion": with_first(quats=0.0),
        "long quaternions": replace(some, quats=some.quats * 1e3),
        "opacity 0 and 1": replace(some, opacity_logits=logits),
        "saturated pixels": opaque,
        # Wide and opaque enough to saturate every pixel of a tile: the rest of its list is skipped.
        "saturated tiles": replace(opaque, log_scales=np.full((20, 3), np.log(0.4))),
        "outside the field of view": with_first(
            means=aside, log_scales=np.log(0.15), opacity_logits=1.0
        ),
    }
    cameras = {
        "one-column image": camera(1, 70, cy=35.0),
        "multiple of the tile size": camera(48, 32),
        "principal point outside": camera(cx=-12.0, cy=50.0),
    }
    scenes = {name: SplatScene(each, view) for name, each in gaussians.items()}
    return scenes | {name: SplatScene(some, each) for name, each in cameras.items()}


BACKENDS: tuple[RasterBackend, ...] = (VectorizedBackend(), CooperativeBackend())


def backend_name(backend: RasterBackend) -> str:
    """For the names of tests."""
    return type(backend).__name__.removesuffix("Backend").lower()
