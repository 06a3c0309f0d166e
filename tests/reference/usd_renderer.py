"""A float64 renderer of USD files: everything it knows comes from the file and from `pxr`.

It shares no code with the package: attributes and metadata are read by their names, pixels come from the
frustum of `Gf.Camera`, Jacobians from differences, spherical harmonics from Legendre functions. Splats are
drawn as OpenUSD's reference renderer draws particle fields (front to back by planar depth, alpha capped
at 0.99, color 0.5 + SH), nothing is added to them, and alpha is cut where the file's metadata says.
"""

import json
from math import factorial, pi, sqrt
from pathlib import Path

import numpy as np


def real_sh(directions: np.ndarray, degree: int) -> np.ndarray:
    """Real spherical harmonics with the Condon-Shortley sign in band m, m = -l..l, shape (n, (degree + 1)^2).

    From associated Legendre functions: Y = sqrt(2) K P(|m|) cos or sin (|m| phi).
    """
    from scipy.special import lpmv

    x, y, z = directions.T
    phi = np.arctan2(y, x)
    columns = []
    for band in range(degree + 1):
        for m in range(-band, band + 1):
            a = abs(m)
            norm = sqrt((2 * band + 1) / (4 * pi) * factorial(band - a) / factorial(band + a))
            legendre = norm * lpmv(a, band, z)  # lpmv carries the Condon-Shortley sign (-1)^m
            if m == 0:
                columns.append(legendre)
            else:
                columns.append(sqrt(2) * legendre * (np.cos(a * phi) if m > 0 else np.sin(a * phi)))
    return np.stack(columns, axis=1)


def frustum_pixels(camera, size: tuple[int, int]):
    """Return a function from stage points (n, 3) to pixels (n, 2) through a `Gf.Camera`'s frustum."""
    frustum = camera.frustum
    # Gf matrices act on row vectors.
    clip_from_stage = np.array(frustum.ComputeViewMatrix() * frustum.ComputeProjectionMatrix())

    def project(points: np.ndarray) -> np.ndarray:
        clip = np.concatenate([points, np.ones((len(points), 1))], axis=1) @ clip_from_stage
        ndc = clip[:, :2] / clip[:, 3:]
        return np.stack([(ndc[:, 0] + 1) / 2 * size[0], (1 - ndc[:, 1]) / 2 * size[1]], axis=1)

    return project


def read_splats(prim) -> dict[str, np.ndarray]:
    """Return positions, rotations (from Gf, element by element), scales, opacities and coefficients."""

    def array(name: str):
        value = prim.GetAttribute(name).Get()
        return value if value else prim.GetAttribute(name + "h").Get()

    rotations = np.array([np.array(_matrix(q)).T for q in array("orientations")])
    degree = prim.GetAttribute("radiance:sphericalHarmonicsDegree").Get()
    sh = np.array(array("radiance:sphericalHarmonicsCoefficients"), dtype=np.float64)
    return {
        "positions": np.array(array("positions"), dtype=np.float64),
        "rotations": rotations.reshape(-1, 3, 3),
        "scales": np.array(array("scales"), dtype=np.float64),
        "opacities": np.array(array("opacities"), dtype=np.float64),
        "sh": sh.reshape(-1, (degree + 1) ** 2, 3),
    }


def _matrix(quat):
    from pxr import Gf

    return Gf.Matrix3d(Gf.Quatd(quat.GetReal(), Gf.Vec3d(quat.GetImaginary())))


def render_usd(path: Path, camera_path: str, time: float, background: np.ndarray) -> np.ndarray:
    """Draw the field of ``path`` as the USD camera sees it at a time code, (height, width, 3)."""
    from pxr import Usd, UsdGeom, UsdRender

    stage = Usd.Stage.Open(str(path))
    prim = next(p for p in stage.Traverse() if p.GetTypeName() == "ParticleField3DGaussianSplat")
    kernel = json.loads(stage.GetRootLayer().customLayerData["digs_warp"])["kernel"]
    product = next(
        UsdRender.Product(p)
        for p in stage.Traverse()
        if p.IsA(UsdRender.Product)
        and camera_path in map(str, UsdRender.Product(p).GetCameraRel().GetTargets())
    )
    size = tuple(product.GetResolutionAttr().Get())
    camera = UsdGeom.Camera(stage.GetPrimAtPath(camera_path)).GetCamera(time)
    splats = read_splats(prim)
    eye = np.array(camera.transform)[3, :3]
    forward = -np.array(camera.transform)[2, :3]
    depths = (splats["positions"] - eye) @ forward
    project = frustum_pixels(camera, size)
    rays = splats["positions"] - eye
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    degree = round(splats["sh"].shape[1] ** 0.5) - 1
    colors = 0.5 + np.einsum("nk,nkc->nc", real_sh(rays, degree), splats["sh"])
    u, v = np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
    pixels = np.stack([u, v], axis=-1)
    image = np.zeros((size[1], size[0], 3))
    left = np.ones((size[1], size[0]))
    for i in np.argsort(depths, kind="stable"):
        if depths[i] <= 0:
            continue
        center = project(splats["positions"][i : i + 1])[0]
        jacobian = _jacobian(project, splats["positions"][i])
        half = jacobian @ splats["rotations"][i] @ np.diag(splats["scales"][i])
        covariance = half @ half.T
        offset = pixels - center
        power = np.einsum("hwi,ij,hwj->hw", offset, np.linalg.inv(covariance), offset)
        alpha = np.minimum(kernel["max_alpha"], splats["opacities"][i] * np.exp(-0.5 * power))
        alpha[alpha < kernel["min_alpha"]] = 0.0
        image += (left * alpha)[..., None] * np.maximum(colors[i], 0.0)
        left *= 1 - alpha
    return image + left[..., None] * background


def _jacobian(project, point: np.ndarray, step: float = 1e-6) -> np.ndarray:
    """Central differences of the pixels, (2, 3)."""
    moves = step * np.eye(3)
    return ((project(point + moves) - project(point - moves)) / (2 * step)).T
