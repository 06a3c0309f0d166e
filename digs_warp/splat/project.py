# type: ignore
# (device code, which Warp's stubs do not type)
"""Projection of Gaussians to splats on the image, and its gradient, one thread per Gaussian.

Legend (EWA splatting as in 3DGS): p = R_cw mu + t the centre in the camera, X = x/z and Y = y/z its
tangents (clamped near the image border), V = R_cw R(q), S = diag(exp(log_scale)),

    m0[k] = fx/z (V[0,k] - X V[2,k]) S[k]      rows of the 2x3 matrix M = J V S
    m1[k] = fy/z (V[1,k] - Y V[2,k]) S[k]
    cov   = M M^T + DILATION I = [[a, b], [b, c]],   conic (A, B, C) = (c, -b, a) / det

det is |m0 x m1|^2 + DILATION (|m0|^2 + |m1|^2) + DILATION^2 (Cauchy-Binet): a sum of squares, so that a
needle of any length keeps a positive determinant in float32.

The gradient is written by hand: it fuses the sum over a splat's tiles, the projection and the colour in
one pass, which Warp's generated adjoint cannot. Tests compare it with central differences of a float64
twin.
"""

import numpy as np
import warp as wp

from digs_warp.camera import Camera
from digs_warp.splat.config import (
    DILATION,
    EXTENT_SLACK,
    JACOBIAN_MARGIN,
    MAX_VARIANCE,
    MIN_ALPHA,
)
from digs_warp.splat.shade import sh_adjoint, sh_color

wp.set_module_options({"enable_backward": False})

# Columns of a splat's record; one record is one cache line.
SPLAT_U = wp.constant(0)
SPLAT_V = wp.constant(1)
SPLAT_A = wp.constant(2)
SPLAT_B = wp.constant(3)
SPLAT_C = wp.constant(4)
SPLAT_OPACITY = wp.constant(5)
SPLAT_RED = wp.constant(6)
SPLAT_GREEN = wp.constant(7)
SPLAT_BLUE = wp.constant(8)
SPLAT_HALF_WIDTH = wp.constant(9)  # half extents [px] of the area with alpha >= MIN_ALPHA
SPLAT_HALF_HEIGHT = wp.constant(10)
SPLAT_TAU = wp.constant(11)  # 2 ln(opacity / MIN_ALPHA): squared Mahalanobis radius of that area
SPLAT_FIELDS = 12

# Columns of the gradient record of one (tile, splat) pair: d/d u, v, A, B, C, opacity, red, green, blue.
GRADIENT_FIELDS = 9

_DILATION = wp.constant(DILATION)
_SLACK = wp.constant(EXTENT_SLACK)
_MARGIN = wp.constant(JACOBIAN_MARGIN)
_MAX_VARIANCE = wp.constant(MAX_VARIANCE)
_MIN_ALPHA = wp.constant(MIN_ALPHA)


@wp.struct
class CameraParams:
    """What the kernels know of a camera; all lengths in pixels or metres."""

    fx: float
    fy: float
    cx: float
    cy: float
    width: int
    height: int
    near: float
    rotation: wp.mat33  # cam_from_world
    translation: wp.vec3
    center_world: wp.vec3


def camera_params(camera: Camera, near: float) -> np.ndarray:
    """Return a one-element structured array for `CameraParams`; ``near`` is the near plane [m]."""
    k = camera.intrinsics
    record = np.zeros(1, dtype=CameraParams.numpy_dtype())
    for name in ("fx", "fy", "cx", "cy", "width", "height"):
        record[name] = getattr(k, name)
    record["near"] = near
    record["rotation"] = camera.cam_from_world[:3, :3]
    record["translation"] = camera.cam_from_world[:3, 3]
    record["center_world"] = camera.center_world
    return record


@wp.func
def rotation_of(quat: wp.vec4) -> wp.mat33:
    """Rotation of a quaternion xyzw that is not normalized; a zero quaternion is no rotation."""
    n = wp.length(quat)
    if n == 0.0:
        return wp.identity(n=3, dtype=float)
    q = quat / n
    x = q[0]
    y = q[1]
    z = q[2]
    w = q[3]
    # fmt: off
    return wp.mat33(
        1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y),
        2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x),
        2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y),
    )
    # fmt: on


@wp.func
def rotation_adjoint(quat: wp.vec4, d: wp.mat33) -> wp.vec4:
    """Gradient of `rotation_of` with respect to the raw quaternion, given the gradient of the matrix."""
    n = wp.length(quat)
    if n == 0.0:
        return wp.vec4(0.0, 0.0, 0.0, 0.0)
    q = quat / n
    x = q[0]
    y = q[1]
    z = q[2]
    w = q[3]
    s01 = d[0, 1] + d[1, 0]
    s02 = d[0, 2] + d[2, 0]
    s12 = d[1, 2] + d[2, 1]
    a21 = d[2, 1] - d[1, 2]
    a02 = d[0, 2] - d[2, 0]
    a10 = d[1, 0] - d[0, 1]
    unit = wp.vec4(
        2.0 * (y * s01 + z * s02 - 2.0 * x * (d[1, 1] + d[2, 2]) + w * a21),
        2.0 * (x * s01 + z * s12 - 2.0 * y * (d[0, 0] + d[2, 2]) + w * a02),
        2.0 * (x * s02 + y * s12 - 2.0 * z * (d[0, 0] + d[1, 1]) + w * a10),
        2.0 * (x * a21 + y * a02 + z * a10),
    )
    # Only the part orthogonal to q changes the normalized quaternion.
    return (unit - q * wp.dot(q, unit)) / n


@wp.func
def clamped_tangent(tangent: float, focal: float, center: float, size: float) -> float:
    """x/z, kept within the image plus a margin; asymmetric for an off-centre principal point."""
    margin = _MARGIN * 0.5 * size / focal
    return wp.clamp(tangent, -center / focal - margin, (size - center) / focal + margin)


@wp.func
def sigmoid(logit: float) -> float:
    """Opacity of a logit."""
    return 1.0 / (1.0 + wp.exp(-logit))


@wp.kernel
def project_kernel(
    first: int,
    cameras: wp.array[CameraParams],  # [1]
    means: wp.array[wp.vec3],  # [n] world
    log_scales: wp.array[wp.vec3],  # [n]
    quats: wp.array[wp.vec4],  # [n] xyzw, raw
    opacity_logits: wp.array[float],  # [n]
    coefficients: wp.array2d[wp.vec3],  # [n, K]
    degree: int,
    # outputs
    splats: wp.array2d[float],  # [n, SPLAT_FIELDS]
    depths: wp.array[float],  # [n] planar depth [m]
    first_tile_rows: wp.array[int],  # [n]
    row_counts: wp.array[int],  # [n] tile rows that the splat touches, 0 if it is not drawn
):
    """Project Gaussians; one that is not drawn gets ``row_counts`` 0 and nothing else."""
    g = first + wp.tid()
    row_counts[g] = 0
    depths[g] = 0.0
    cam = cameras[0]
    p = cam.rotation * means[g] + cam.translation
    z = p[2]
    opacity = sigmoid(opacity_logits[g])
    # Written so that NaN anywhere ends here, too.
    if not (z > cam.near and opacity > _MIN_ALPHA):
        return
    tx = clamped_tangent(p[0] / z, cam.fx, cam.cx, float(cam.width))
    ty = clamped_tangent(p[1] / z, cam.fy, cam.cy, float(cam.height))
    v = cam.rotation * rotation_of(quats[g])
    s = wp.vec3(wp.exp(log_scales[g][0]), wp.exp(log_scales[g][1]), wp.exp(log_scales[g][2]))
    m0 = cam.fx / z * wp.cw_mul(v[0] - tx * v[2], s)
    m1 = cam.fy / z * wp.cw_mul(v[1] - ty * v[2], s)
    aa = wp.dot(m0, m0)
    cc = wp.dot(m1, m1)
    if not (aa < _MAX_VARIANCE and cc < _MAX_VARIANCE):
        return
    b = wp.dot(m0, m1)
    cross = wp.cross(m0, m1)
    det = wp.dot(cross, cross) + _DILATION * (aa + cc) + _DILATION * _DILATION
    tau = 2.0 * wp.log(opacity / _MIN_ALPHA)
    half_width = wp.sqrt(tau * (aa + _DILATION)) + _SLACK
    half_height = wp.sqrt(tau * (cc + _DILATION)) + _SLACK
    pu = cam.fx * p[0] / z + cam.cx
    pv = cam.fy * p[1] / z + cam.cy
    width = float(cam.width)
    height = float(cam.height)
    if not (pu + half_width > 0.5 and pu - half_width < width - 0.5):
        return
    if not (pv + half_height > 0.5 and pv - half_height < height - 0.5):
        return
    # Clamped as floats: a huge splat would overflow an integer.
    top = int(wp.max(wp.ceil(pv - half_height - 0.5), 0.0))
    bottom = int(wp.min(wp.floor(pv + half_height - 0.5), height - 1.0))
    if top > bottom:
        return
    color = sh_color(coefficients, g, degree, wp.normalize(means[g] - cam.center_world))
    if not (color[0] + color[1] + color[2] < 1.0e9):
        return
    splats[g, SPLAT_U] = pu
    splats[g, SPLAT_V] = pv
    splats[g, SPLAT_A] = (cc + _DILATION) / det
    splats[g, SPLAT_B] = -b / det
    splats[g, SPLAT_C] = (aa + _DILATION) / det
    splats[g, SPLAT_OPACITY] = opacity
    splats[g, SPLAT_RED] = wp.max(color[0], 0.0)
    splats[g, SPLAT_GREEN] = wp.max(color[1], 0.0)
    splats[g, SPLAT_BLUE] = wp.max(color[2], 0.0)
    splats[g, SPLAT_HALF_WIDTH] = half_width
    splats[g, SPLAT_HALF_HEIGHT] = half_height
    splats[g, SPLAT_TAU] = tau
    depths[g] = z
    first_tile_rows[g] = top // 16
    row_counts[g] = bottom // 16 - top // 16 + 1


@wp.kernel
def project_backward_kernel(
    first: int,
    cameras: wp.array[CameraParams],
    means: wp.array[wp.vec3],
    log_scales: wp.array[wp.vec3],
    quats: wp.array[wp.vec4],
    coefficients: wp.array2d[wp.vec3],
    degree: int,
    splats: wp.array2d[float],
    pair_starts: wp.array[int],  # [n + 1] pairs of splat g: pair_starts[g] .. pair_starts[g + 1]
    pair_slots: wp.array[int],  # [pairs] where the gradient record of a pair lies
    pair_gradients: wp.array2d[float],  # [pairs, GRADIENT_FIELDS]
    # outputs
    adj_means: wp.array[wp.vec3],
    adj_log_scales: wp.array[wp.vec3],
    adj_quats: wp.array[wp.vec4],
    adj_opacity_logits: wp.array[float],
    adj_coefficients: wp.array2d[wp.vec3],
):
    """Sum a splat's gradient over its tiles in a fixed order and pull it back to the parameters."""
    g = first + wp.tid()
    begin = pair_starts[g]
    end = pair_starts[g + 1]
    if begin == end:
        adj_means[g] = wp.vec3(0.0, 0.0, 0.0)
        adj_log_scales[g] = wp.vec3(0.0, 0.0, 0.0)
        adj_quats[g] = wp.vec4(0.0, 0.0, 0.0, 0.0)
        adj_opacity_logits[g] = 0.0
        for k in range(adj_coefficients.shape[1]):
            adj_coefficients[g, k] = wp.vec3(0.0, 0.0, 0.0)
        return

    du = float(0.0)
    dv = float(0.0)
    da = float(0.0)
    db = float(0.0)
    dc = float(0.0)
    d_opacity = float(0.0)
    d_color = wp.vec3(0.0, 0.0, 0.0)
    for pair in range(begin, end):
        slot = pair_slots[pair]
        du += pair_gradients[slot, 0]
        dv += pair_gradients[slot, 1]
        da += pair_gradients[slot, 2]
        db += pair_gradients[slot, 3]
        dc += pair_gradients[slot, 4]
        d_opacity += pair_gradients[slot, 5]
        d_color += wp.vec3(
            pair_gradients[slot, 6], pair_gradients[slot, 7], pair_gradients[slot, 8]
        )

    cam = cameras[0]
    p = cam.rotation * means[g] + cam.translation
    z = p[2]
    inverse_z = 1.0 / z
    tan_x = p[0] * inverse_z
    tan_y = p[1] * inverse_z
    tx = clamped_tangent(tan_x, cam.fx, cam.cx, float(cam.width))
    ty = clamped_tangent(tan_y, cam.fy, cam.cy, float(cam.height))
    v = cam.rotation * rotation_of(quats[g])
    s = wp.vec3(wp.exp(log_scales[g][0]), wp.exp(log_scales[g][1]), wp.exp(log_scales[g][2]))
    kx = cam.fx * inverse_z
    ky = cam.fy * inverse_z
    m0 = kx * wp.cw_mul(v[0] - tx * v[2], s)
    m1 = ky * wp.cw_mul(v[1] - ty * v[2], s)

    # conic -> covariance: G_cov = -Q G_Q Q with the symmetric G_Q = [[da, db/2], [db/2, dc]].
    qa = splats[g, SPLAT_A]
    qb = splats[g, SPLAT_B]
    qc = splats[g, SPLAT_C]
    h00 = da * qa + 0.5 * db * qb
    h01 = da * qb + 0.5 * db * qc
    h10 = 0.5 * db * qa + dc * qb
    h11 = 0.5 * db * qb + dc * qc
    g00 = -(qa * h00 + qb * h10)
    g01 = -(qa * h01 + qb * h11)
    g11 = -(qb * h01 + qc * h11)
    # covariance -> M: G_M = 2 G_cov M
    dm0 = 2.0 * (g00 * m0 + g01 * m1)
    dm1 = 2.0 * (g01 * m0 + g11 * m1)

    weighted = wp.cw_mul(dm0, m0) + wp.cw_mul(dm1, m1)
    adj_log_scales[g] = weighted
    dm0_s = kx * wp.cw_mul(dm0, s)
    dm1_s = ky * wp.cw_mul(dm1, s)
    dv2 = -tx * dm0_s - ty * dm1_s
    d_rotation = wp.transpose(cam.rotation) * wp.matrix_from_rows(dm0_s, dm1_s, dv2)
    adj_quats[g] = rotation_adjoint(quats[g], d_rotation)

    # centre: through the pixel position, the scale 1/z of M, and the tangents where not clamped
    dp = wp.vec3(
        du * kx,
        dv * ky,
        -(du * kx * tan_x + dv * ky * tan_y)
        - inverse_z * (weighted[0] + weighted[1] + weighted[2]),
    )
    if tx == tan_x:
        d_tx = -wp.dot(dm0_s, v[2])
        dp += wp.vec3(d_tx * inverse_z, 0.0, -d_tx * tan_x * inverse_z)
    if ty == tan_y:
        d_ty = -wp.dot(dm1_s, v[2])
        dp += wp.vec3(0.0, d_ty * inverse_z, -d_ty * tan_y * inverse_z)
    d_mean = wp.transpose(cam.rotation) * dp

    # colour: no gradient where the clamp at 0 holds
    for channel in range(3):
        if splats[g, SPLAT_RED + channel] <= 0.0:
            d_color[channel] = 0.0
    offset = means[g] - cam.center_world
    distance = wp.length(offset)
    direction = offset / distance
    d_direction = sh_adjoint(coefficients, g, degree, direction, d_color, adj_coefficients)
    for k in range((degree + 1) * (degree + 1), adj_coefficients.shape[1]):
        adj_coefficients[g, k] = wp.vec3(0.0, 0.0, 0.0)
    d_mean += (d_direction - direction * wp.dot(direction, d_direction)) / distance
    adj_means[g] = d_mean

    opacity = splats[g, SPLAT_OPACITY]
    adj_opacity_logits[g] = d_opacity * opacity * (1.0 - opacity)
