"""Float64 twin of motion blur: the mean of sharp twins along the exposure, and of their gradients."""

from dataclasses import dataclass, fields, replace

import numpy as np

from digs_warp.geometry.camera import Camera
from digs_warp.splat.camera_motion import RowMotion
from digs_warp.splat.config import RasterOptions
from reference.splat_scenes import SplatScene
from reference.splat_twin import Adjoints, Parameters, TwinView, render_twin, twin_gradients


@dataclass
class BlurTwin:
    image: np.ndarray  # (height, width, 3)
    transmittance: np.ndarray  # (height, width)
    depth: np.ndarray  # (height, width) of the moment nearest to the middle
    ambiguous: np.ndarray  # (height, width)


def moments_of(count: int) -> np.ndarray:
    """Evenly spaced around 0 with the variance of an exposure, 1/12; the nearest to the middle first."""
    even = np.arange(count) - (count - 1) / 2
    nearest_first = np.array(sorted(even, key=abs))
    return nearest_first * np.sqrt(1 / 12 / np.mean(even**2))


def cameras_of(scene: SplatScene, motion: RowMotion, count: int) -> list[Camera]:
    poses = TwinView.of(scene.camera, motion).at(moments_of(count))
    return [replace(scene.camera, world_from_cam=pose) for pose in poses]


def render_blurred(
    scene: SplatScene, cameras: list[Camera], background: np.ndarray, options: RasterOptions
) -> BlurTwin:
    p = Parameters.of(scene.gaussians)
    views = [
        render_twin(p, each, scene.near, background, options, rows=scene.rows) for each in cameras
    ]
    return BlurTwin(
        np.mean([view.image for view in views], axis=0),
        np.mean([view.transmittance for view in views], axis=0),
        views[0].depth,
        np.any([view.ambiguous for view in views], axis=0),
    )


def blurred_gradients(
    scene: SplatScene,
    cameras: list[Camera],
    background: np.ndarray,
    adjoints: Adjoints,
    options: RasterOptions,
) -> Parameters:
    """Of the product of the adjoints with image, transmittance and depth."""
    p, count = Parameters.of(scene.gaussians), len(cameras)
    total = Parameters(*(np.zeros_like(getattr(p, f.name)) for f in fields(Parameters)))
    for number, each in enumerate(cameras):
        share = Adjoints(
            adjoints.image / count,
            adjoints.transmittance / count,
            adjoints.depth * (number == 0),
        )
        view = render_twin(p, each, scene.near, background, options, rows=scene.rows)
        found = twin_gradients(p, each, view, background, share, options, scene.rows).parameters
        for f in fields(Parameters):
            getattr(total, f.name)[...] += getattr(found, f.name)
    return total
