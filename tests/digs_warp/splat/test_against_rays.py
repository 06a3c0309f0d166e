"""Discs against rays: every pixel's ray is cut with the planes of the discs, with no projection of any splat.

The image of a flat Gaussian is linearized at its center, the ray is not: small discs before a long lens keep
the difference below one percent. What this checks independently of every twin: where the camera puts things,
which way quaternions turn, what a standard deviation is, and who covers whom.
"""

import numpy as np

from digs_warp.data.gaussians import Gaussians
from digs_warp.geometry.camera import Camera, Intrinsics, pixel_centers
from digs_warp.geometry.rigid import look_at, matrix_from_quat_xyzw
from digs_warp.geometry.sh import sh_from_rgb
from digs_warp.splat.config import RasterOptions
from digs_warp.splat.render import render

OPTIONS = RasterOptions(dilation=1e-3, outputs="depth")
BACKGROUND = np.array([0.1, 0.2, 0.3])
EYE = np.array([3.0, -8.0, 4.0])
VIEW = Camera(
    Intrinsics(96, 80, 900.0, 940.0, 41.0, 47.0),
    look_at(EYE, np.array([0.05, 0.0, 0.02]), np.array([0.0, 0.0, 1.0])),
)
COLORS = np.array([[0.9, 0.2, 0.1], [0.1, 0.8, 0.3], [0.2, 0.3, 0.9], [0.9, 0.9, 0.1]])
OPACITIES = np.array([0.95, 0.7, 0.98, 0.5])


def discs() -> Gaussians:
    """Four tilted, overlapping discs, none of them parallel to the image."""
    towards = EYE / np.linalg.norm(EYE)
    means = np.array([[0.0, 0, 0], [0.12, 0.02, 0.05], [-0.1, 0.05, -0.08], [0.05, 0, 0.12]])
    means += np.array([[0.0], [0.3], [0.6], [-0.5]]) * towards  # clearly before one another
    return Gaussians(
        means=means,
        log_scales=np.log(
            [[0.1, 0.05, 1e-5], [0.04, 0.12, 1e-5], [0.06, 0.06, 1e-5], [0.15, 0.03, 1e-5]]
        ),
        quats=np.random.default_rng(12).normal(size=(4, 4)),
        opacity_logits=np.log(OPACITIES / (1 - OPACITIES)),
        sh=sh_from_rgb(COLORS)[:, None, :],
    )


def cast_rays(gaussians: Gaussians) -> tuple[np.ndarray, np.ndarray]:
    """Colors and coverage where the rays of all pixels cut the planes of the discs, nearest first."""
    k = VIEW.intrinsics
    px = pixel_centers(k.width, k.height)
    points = VIEW.unproject(px, np.ones(px.shape[:2]))
    rays = points - EYE  # planar depth grows by 1 along a ray
    distances, alphas = [], []
    for i in range(len(gaussians)):
        axes = matrix_from_quat_xyzw(gaussians.quats[i].astype(np.float64))
        mean = gaussians.means[i].astype(np.float64)
        depth = ((mean - EYE) @ axes[:, 2]) / (rays @ axes[:, 2])
        local = (EYE + depth[..., None] * rays - mean) @ axes[:, :2] / gaussians.scales[i, :2]
        alpha = OPACITIES[i] * np.exp(-0.5 * (local**2).sum(axis=-1))
        distances.append(np.full(depth.shape, np.linalg.norm(mean - EYE)))
        alphas.append(np.where(alpha >= 1 / 255, alpha, 0.0))
    order = np.argsort([d[0, 0] for d in distances])
    color, through = np.zeros((*px.shape[:2], 3)), np.ones(px.shape[:2])
    for i in order:
        color += (through * alphas[i])[..., None] * COLORS[i]
        through *= 1 - alphas[i]
    return color + through[..., None] * BACKGROUND, 1 - through


def test_discs_are_where_rays_meet_them() -> None:
    gaussians = discs()
    expected, coverage = cast_rays(gaussians)
    found = render(gaussians, VIEW, near=0.1, background=tuple(BACKGROUND), options=OPTIONS)
    assert (coverage > 0.5).sum() > 250
    difference = np.abs(found.image - expected)
    assert difference.mean() < 0.0005
    assert difference.max() < 0.015
    assert np.abs(found.alpha - coverage).mean() < 0.001
