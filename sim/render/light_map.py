"""How much light reaches a floor or a table top: two grids around what stands on it."""

# Warp's stubs do not type device code.
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false, reportReturnType=false
# pyright: reportGeneralTypeIssues=false, reportInvalidTypeForm=false, reportOperatorIssue=false

import warp as wp

wp.set_module_options({"enable_backward": False})

# Share of a grid's width over which it passes into the next wider one.
BLEND = wp.constant(0.08)


@wp.struct
class LightGrid:
    """Openness, and the visible share of the bright spots, at the nodes of a grid along x and y."""

    values: wp.array2d[wp.vec2]  # [rows along y, columns along x]
    low: wp.vec2  # first node [m]
    size: wp.vec2  # from the first node to the last [m]


@wp.struct
class LightMap:
    """A horizontal plane that things stand on; ``exists`` 0: none."""

    exists: int
    height: float  # [m]
    low: wp.vec2  # corners of the plane [m]
    high: wp.vec2
    fine: LightGrid
    coarse: LightGrid
    smooth: wp.vec3  # light of the environment on the open plane, without the bright spots
    keyed: wp.vec3  # light of the bright spots
    glow: wp.vec3  # radiance of the open plane, where it is known
    is_soft: int  # 1: the spots are so wide that the grids hold their shadows
    material: int  # of the faces on the plane; -1: no faces, part of the surround


@wp.func
def is_over(plane: LightMap, x: float, y: float) -> bool:
    """Whether a place is within the corners of the plane."""
    return x >= plane.low[0] and y >= plane.low[1] and x <= plane.high[0] and y <= plane.high[1]


@wp.func
def grid_weight(grid: LightGrid, x: float, y: float) -> float:
    """1 inside the grid, falling to 0 at its border."""
    u = (x - grid.low[0]) / grid.size[0]
    v = (y - grid.low[1]) / grid.size[1]
    inward = wp.min(wp.min(u, 1.0 - u), wp.min(v, 1.0 - v))
    return wp.clamp(inward / BLEND, 0.0, 1.0)


@wp.func
def grid_value(grid: LightGrid, x: float, y: float) -> wp.vec2:
    """Bilinear value inside the grid."""
    rows = grid.values.shape[0]
    columns = grid.values.shape[1]
    u = wp.clamp((x - grid.low[0]) / grid.size[0], 0.0, 1.0) * float(columns - 1)
    v = wp.clamp((y - grid.low[1]) / grid.size[1], 0.0, 1.0) * float(rows - 1)
    left = wp.min(int(u), columns - 2)
    low = wp.min(int(v), rows - 2)
    fu = u - float(left)
    fv = v - float(low)
    near = wp.lerp(grid.values[low, left], grid.values[low, left + 1], fu)
    far = wp.lerp(grid.values[low + 1, left], grid.values[low + 1, left + 1], fu)
    return wp.lerp(near, far, fv)


@wp.func
def light_on(plane: LightMap, x: float, y: float) -> wp.vec2:
    """Openness of a place of the plane, and the visible share of soft spots; 1 far from everything."""
    value = wp.vec2(1.0, 1.0)
    outer = grid_weight(plane.coarse, x, y)
    if outer > 0.0:
        value = wp.lerp(value, grid_value(plane.coarse, x, y), outer)
        inner = grid_weight(plane.fine, x, y)
        if inner > 0.0:
            value = wp.lerp(value, grid_value(plane.fine, x, y), inner)
    return value


@wp.func
def openness_on(plane: LightMap, x: float, y: float) -> float:
    """Share of the sky that a place of the plane sees, weighted by the cosine; 1 far from everything."""
    return light_on(plane, x, y)[0]


@wp.func
def plane_distance(plane: LightMap, origin: wp.vec3, direction: wp.vec3, slack: float) -> float:
    """Distance along a ray from above to the plane; -1: it does not meet it.

    Rays that start up to ``slack`` [m] below the plane start on it.
    """
    found = wp.float32(-1.0)
    if plane.exists == 1 and direction[2] < 0.0 and origin[2] > plane.height - slack:
        distance = wp.max((plane.height - origin[2]) / direction[2], 0.0)
        x = origin[0] + distance * direction[0]
        y = origin[1] + distance * direction[1]
        if is_over(plane, x, y):
            found = distance
    return found
