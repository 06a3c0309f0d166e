"""Frames with a closed-form truth, made without a renderer: planes, steps and discs of any texture."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.scene.scene import Material
from digs_warp.sim.sensor.frame import FrameTruth, Motion

PLAIN = Material("plain", np.ones(3), roughness=1.0)


def make_rig(width: int = 320, height: int = 240, **changes: Any) -> StereoRig:
    """A rig with f b = 50 px m that sees 0.2 to 20 m; without any figure that effects would use."""
    figures: dict[str, Any] = {
        "disparity_sigma": 0.0,
        "disparity_step": 0.0,
        "min_depth": 0.2,
        "max_depth": 20.0,
        "static_field": 0.0,
    }
    intrinsics = Intrinsics(width, height, 500.0, 500.0, width / 2, height / 2)
    return StereoRig(intrinsics=intrinsics, baseline=0.1, **{**figures, **changes})


def broadband(shape: tuple[int, int], seed: int = 0, contrast: float = 40.0) -> np.ndarray:
    """A texture of all scales (amplitude 1/f) round mid-gray, (height, width, 3), uint8."""
    rng = np.random.default_rng(seed)
    spectrum = np.fft.rfft2(rng.standard_normal(shape))
    frequency = np.hypot(np.fft.fftfreq(shape[0])[:, None], np.fft.rfftfreq(shape[1]))
    texture = np.fft.irfft2(spectrum / np.maximum(frequency, 1 / max(shape)), shape)
    gray = np.clip(np.rint(128 + contrast * texture / max(texture.std(), 1e-9)), 20, 245)
    return np.repeat(gray.astype(np.uint8)[..., None], 3, axis=2)


def flat(shape: tuple[int, int], value: int = 128) -> np.ndarray:
    """An image of one gray value."""
    return np.full((*shape, 3), value, dtype=np.uint8)


@dataclass
class CountedRays:
    """Rays of a scene in which nothing hides, mirrors or shines through; counts what is asked for."""

    shape: tuple[int, int]
    asked: list[str] = field(default_factory=list)

    def right_visibility(
        self, where: np.ndarray | None = None, depth: np.ndarray | None = None
    ) -> np.ndarray:
        self.asked.append("right_visibility")
        return np.ones(self.shape, dtype=bool)

    def reflection_distance(self, where: np.ndarray | None = None) -> np.ndarray:
        self.asked.append("reflection_distance")
        return np.full(self.shape, 10.0, dtype=np.float32)

    def depth_behind(self, where: np.ndarray | None = None) -> np.ndarray:
        self.asked.append("depth_behind")
        return np.full(self.shape, 10.0, dtype=np.float32)


def make_frame(
    disparity: np.ndarray | float,
    rig: StereoRig | None = None,
    image: np.ndarray | None = None,
    number: int = 0,
    motion: Motion | None = None,
) -> FrameTruth:
    """A frame of the given true disparity [px] (scalar: a plane across the view), well textured."""
    rig = rig or make_rig()
    k = rig.intrinsics
    shape = (k.height, k.width)
    depth = np.broadcast_to(rig.focal_baseline / np.asarray(disparity, np.float64), shape)
    image = broadband(shape) if image is None else image
    return FrameTruth(
        number=number,
        camera=Camera(k, np.eye(4)),
        rig=rig,
        image=image,
        right=image,
        depth=depth.astype(np.float32),
        normals_world=np.broadcast_to(np.array([0, 0, -1], np.float32), (*shape, 3)),
        material_ids=np.zeros(shape, dtype=np.int32),
        materials=(PLAIN,),
        motion=motion or Motion((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        rays=CountedRays(shape),
    )
