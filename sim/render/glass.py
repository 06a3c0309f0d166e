"""How a ray bends where it enters or leaves a body of glass."""

# Warp's stubs do not type device code.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false, reportOperatorIssue=false

import warp as wp

wp.set_module_options({"enable_backward": False})

# A bent ray leaves the triangle at least this steeply: interpolated normals may send it along or back.
LEAST_SLOPE = wp.constant(1.0e-3)


@wp.struct
class Bend:
    """The ray behind the surface."""

    direction: wp.vec3  # unit
    is_reflected: bool  # all of it: total internal reflection
    cosine: float  # between the ray outside the body and the normal


@wp.func
def bend(
    direction: wp.vec3, normal: wp.vec3, facet_normal: wp.vec3, ior: float, enters: bool
) -> Bend:
    """Snell's law, and total internal reflection where it has no solution.

    Both normals point against the ray: ``normal`` of the smooth surface, ``facet_normal`` of the triangle.
    """
    ratio = wp.where(enters, 1.0 / ior, ior)
    cosine = wp.clamp(-wp.dot(direction, normal), 0.0, 1.0)
    behind2 = 1.0 - ratio * ratio * (1.0 - cosine * cosine)
    result = Bend()
    away = -facet_normal
    if behind2 > 0.0:
        behind = wp.sqrt(behind2)
        result.direction = ratio * direction + (ratio * cosine - behind) * normal
        result.cosine = wp.where(enters, cosine, behind)
    else:
        result.is_reflected = True
        result.direction = direction + 2.0 * cosine * normal
        away = facet_normal
    missing = wp.max(LEAST_SLOPE - wp.dot(result.direction, away), 0.0)
    result.direction = wp.normalize(result.direction + missing * away)
    return result
