"""Spherical harmonics on the device: the Warp twin of `digs_warp.geometry.sh`, and its gradient.

Plain functions of one Gaussian, so that projection and its gradient can call them in their own pass.
"""

import warp as wp

from digs_warp.geometry import sh

wp.set_module_options({"enable_backward": False})

_C0 = wp.constant(sh.C0)
_C1 = wp.constant(sh.C1)
_C20, _C21, _C22, _C23, _C24 = (wp.constant(value) for value in sh.C2)
_C30, _C31, _C32, _C33, _C34, _C35, _C36 = (wp.constant(value) for value in sh.C3)


@wp.func
def sh_color(coefficients: wp.array2d[wp.vec3], g: int, degree: int, d: wp.vec3) -> wp.vec3:
    """Color of Gaussian g seen along the unit vector d, before the clamp at 0; see `geometry/sh.py`."""
    x = d[0]
    y = d[1]
    z = d[2]
    color = wp.vec3(0.5, 0.5, 0.5) + _C0 * coefficients[g, 0]
    if degree >= 1:
        color += _C1 * (-y * coefficients[g, 1] + z * coefficients[g, 2] - x * coefficients[g, 3])
    if degree >= 2:
        color += _C20 * x * y * coefficients[g, 4] + _C21 * y * z * coefficients[g, 5]
        color += _C22 * (2.0 * z * z - x * x - y * y) * coefficients[g, 6]
        color += _C23 * x * z * coefficients[g, 7] + _C24 * (x * x - y * y) * coefficients[g, 8]
    if degree >= 3:
        color += _C30 * y * (3.0 * x * x - y * y) * coefficients[g, 9]
        color += _C31 * x * y * z * coefficients[g, 10]
        color += _C32 * y * (4.0 * z * z - x * x - y * y) * coefficients[g, 11]
        color += _C33 * z * (2.0 * z * z - 3.0 * x * x - 3.0 * y * y) * coefficients[g, 12]
        color += _C34 * x * (4.0 * z * z - x * x - y * y) * coefficients[g, 13]
        color += _C35 * z * (x * x - y * y) * coefficients[g, 14]
        color += _C36 * x * (x * x - 3.0 * y * y) * coefficients[g, 15]
    return color


@wp.func
def sh_adjoint(
    coefficients: wp.array2d[wp.vec3],
    g: int,
    degree: int,
    d: wp.vec3,
    adj_color: wp.vec3,
    adj_coefficients: wp.array2d[wp.vec3],
) -> wp.vec3:
    """Write the gradient of `sh_color` in the coefficients; return the one in the direction."""
    x = d[0]
    y = d[1]
    z = d[2]
    adj_coefficients[g, 0] = _C0 * adj_color
    adj_d = wp.vec3(0.0, 0.0, 0.0)
    if degree >= 1:
        adj_coefficients[g, 1] = -_C1 * y * adj_color
        adj_coefficients[g, 2] = _C1 * z * adj_color
        adj_coefficients[g, 3] = -_C1 * x * adj_color
        s1 = wp.dot(coefficients[g, 1], adj_color)
        s2 = wp.dot(coefficients[g, 2], adj_color)
        s3 = wp.dot(coefficients[g, 3], adj_color)
        adj_d += _C1 * wp.vec3(-s3, -s1, s2)
    if degree >= 2:
        adj_coefficients[g, 4] = _C20 * x * y * adj_color
        adj_coefficients[g, 5] = _C21 * y * z * adj_color
        adj_coefficients[g, 6] = _C22 * (2.0 * z * z - x * x - y * y) * adj_color
        adj_coefficients[g, 7] = _C23 * x * z * adj_color
        adj_coefficients[g, 8] = _C24 * (x * x - y * y) * adj_color
        s4 = _C20 * wp.dot(coefficients[g, 4], adj_color)
        s5 = _C21 * wp.dot(coefficients[g, 5], adj_color)
        s6 = _C22 * wp.dot(coefficients[g, 6], adj_color)
        s7 = _C23 * wp.dot(coefficients[g, 7], adj_color)
        s8 = _C24 * wp.dot(coefficients[g, 8], adj_color)
        adj_d += wp.vec3(
            y * s4 - 2.0 * x * s6 + z * s7 + 2.0 * x * s8,
            x * s4 + z * s5 - 2.0 * y * s6 - 2.0 * y * s8,
            y * s5 + 4.0 * z * s6 + x * s7,
        )
    if degree >= 3:
        xx = x * x
        yy = y * y
        zz = z * z
        adj_coefficients[g, 9] = _C30 * y * (3.0 * xx - yy) * adj_color
        adj_coefficients[g, 10] = _C31 * x * y * z * adj_color
        adj_coefficients[g, 11] = _C32 * y * (4.0 * zz - xx - yy) * adj_color
        adj_coefficients[g, 12] = _C33 * z * (2.0 * zz - 3.0 * xx - 3.0 * yy) * adj_color
        adj_coefficients[g, 13] = _C34 * x * (4.0 * zz - xx - yy) * adj_color
        adj_coefficients[g, 14] = _C35 * z * (xx - yy) * adj_color
        adj_coefficients[g, 15] = _C36 * x * (xx - 3.0 * yy) * adj_color
        s9 = _C30 * wp.dot(coefficients[g, 9], adj_color)
        s10 = _C31 * wp.dot(coefficients[g, 10], adj_color)
        s11 = _C32 * wp.dot(coefficients[g, 11], adj_color)
        s12 = _C33 * wp.dot(coefficients[g, 12], adj_color)
        s13 = _C34 * wp.dot(coefficients[g, 13], adj_color)
        s14 = _C35 * wp.dot(coefficients[g, 14], adj_color)
        s15 = _C36 * wp.dot(coefficients[g, 15], adj_color)
        adj_d += wp.vec3(
            6.0 * x * y * s9 + y * z * s10 - 2.0 * x * y * s11 - 6.0 * x * z * s12,
            3.0 * (xx - yy) * s9
            + x * z * s10
            + (4.0 * zz - xx - 3.0 * yy) * s11
            - 6.0 * y * z * s12,
            x * y * s10 + 8.0 * y * z * s11 + (6.0 * zz - 3.0 * xx - 3.0 * yy) * s12,
        )
        adj_d += wp.vec3(
            (4.0 * zz - 3.0 * xx - yy) * s13 + 2.0 * x * z * s14 + 3.0 * (xx - yy) * s15,
            -2.0 * x * y * s13 - 2.0 * y * z * s14 - 6.0 * x * y * s15,
            8.0 * x * z * s13 + (xx - yy) * s14,
        )
    return adj_d
