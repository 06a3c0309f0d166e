"""What the raster kernels read and write: structs of arrays, and the layout of records and groups.

A group of Gaussians lies in local memory field by field: LLVM works on all of a group at once. Component c of
a field lies c groups after the first one, one member after the other.
"""

from dataclasses import dataclass
from typing import Any

import warp as wp

from digs_warp.device.image_planes import ImagePlanes
from digs_warp.device.parallel import packed
from digs_warp.splat.footprint import ViewParams

wp.set_module_options({"enable_backward": False})

# Columns of a splat's record: what a tile reads of a splat lies together.
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
# In the column dx off the center, that area is slope dx -+ sqrt(chord - taper dx^2); it reaches furthest up
# and down on the image at dx = -peak and peak.
SPLAT_SLOPE = wp.constant(12)
SPLAT_CHORD = wp.constant(13)
SPLAT_TAPER = wp.constant(14)
SPLAT_PEAK = wp.constant(15)
SPLAT_FIELDS = 16  # one cache line

# The gradient record of a (tile, splat) pair: d/d u, v, A, B, C, opacity, red, green, blue, and where a view
# has depth, in one more column, d/d depth.
COLOR_FIELDS = 9


@wp.struct
class Splats:
    """The n splats of a view, as projection leaves them."""

    views: wp.array[ViewParams]  # [1]
    records: wp.array2d[float]  # [n, SPLAT_FIELDS]
    centers: wp.array[float]  # [n] planar depth of the center [m], 0 if it is not drawn
    depths: wp.array[float]  # [n] planar depth of what the view shows of it [m]
    boxes: wp.array[wp.vec4i]  # [n] first tile column and row, and how many; 0 if it is not drawn


@wp.struct
class TilePairs:
    """The (tile, splat) pairs of a view, by tile, nearest splat first."""

    starts: wp.array[int]  # [tiles + 1] pairs of tile t: starts[t] .. starts[t + 1]
    members: wp.array[wp.vec2i]  # [pairs] splat, and where the gradient record of the pair goes
    blocks: wp.array[
        int
    ]  # [pairs] a bit for each block of the tile that was drawn in; vector code only


@wp.struct
class Planes:
    """What is drawn of a view, or the gradient of a loss in it: padded planes, zero outside of the image."""

    pitch: int  # floats from one image row to the next
    plane: int  # floats from one channel to the next
    origin: int  # index of pixel (0, 0)
    image: wp.array[float]  # 3 planes
    transmittance: wp.array[float]  # 1 plane
    depth: wp.array[float]  # 2 planes: expected and median; of the gradient only the first


@wp.struct
class PairGradients:
    """Gradient records of the pairs, by splat."""

    starts: wp.array[int]  # [n + 1] pairs of splat g: starts[g] .. starts[g + 1]
    records: wp.array2d[float]  # [pairs, `COLOR_FIELDS`, and one of depth]


@wp.struct
class StatisticsArrays:
    """`digs_warp.splat.device.SplatStatistics` for kernels; empty arrays: not wanted."""

    gradient_sums: wp.array[float]  # [n]
    counts: wp.array[float]  # [n]


@wp.struct
class GaussianArrays:
    """`digs_warp.splat.device.DeviceGaussians` for kernels: parameters or their gradients."""

    means: wp.array[wp.vec3]  # [n] world
    log_scales: wp.array[wp.vec3]  # [n]
    quats: wp.array[wp.vec4]  # [n] xyzw, raw
    opacity_logits: wp.array[float]  # [n]
    sh: wp.array2d[wp.vec3]  # [n, K]


@dataclass(frozen=True, eq=False)
class ViewPlanes:
    """The planes of a view, or of a gradient in it; those that are not wanted have no channels."""

    image: ImagePlanes
    transmittance: ImagePlanes
    depth: ImagePlanes

    def resize(self, width: int, height: int) -> None:
        """Hold a view of another size."""
        for planes in vars(self).values():
            planes.resize(width, height)

    def for_kernels(self) -> Any:
        """Return the planes as kernels take them, `Planes`."""
        layout = {name: getattr(self.image, name) for name in ("pitch", "plane", "origin")}
        return packed(Planes, **layout, **{name: p.data for name, p in vars(self).items()})


# Gaussians in a group.
GROUP_SIZE = 16

_GROUP = wp.constant(GROUP_SIZE)
# Where the parameters lie, after the place at which they begin; and how many fields they are.
_LOG_SCALE = wp.constant(3 * GROUP_SIZE)
_QUAT = wp.constant(6 * GROUP_SIZE)
_LOGIT = wp.constant(10 * GROUP_SIZE)
GROUP_PARAMETERS = 11


@wp.func
def vec3_at(state: wp.array[float], first: int) -> wp.vec3:
    """Vector whose components lie a group apart."""
    return wp.vec3(state[first], state[first + _GROUP], state[first + 2 * _GROUP])


@wp.func
def put_vec3(value: wp.vec3, state: wp.array[float], first: int):
    """Write what `vec3_at` reads."""
    state[first] = value[0]
    state[first + _GROUP] = value[1]
    state[first + 2 * _GROUP] = value[2]


@wp.func
def vec4_at(state: wp.array[float], first: int) -> wp.vec4:
    """Vector whose components lie a group apart."""
    return wp.vec4(
        state[first],
        state[first + _GROUP],
        state[first + 2 * _GROUP],
        state[first + 3 * _GROUP],
    )


@wp.func
def put_vec4(value: wp.vec4, state: wp.array[float], first: int):
    """Write what `vec4_at` reads."""
    state[first] = value[0]
    state[first + _GROUP] = value[1]
    state[first + 2 * _GROUP] = value[2]
    state[first + 3 * _GROUP] = value[3]


@wp.func
def put_parameters(
    mean: wp.vec3,
    log_scale: wp.vec3,
    quat: wp.vec4,
    opacity_logit: float,
    state: wp.array[float],
    first: int,
):
    """Write what shapes a Gaussian; ``first`` is where its group's parameters begin, and its place in it."""
    put_vec3(mean, state, first)
    put_vec3(log_scale, state, first + _LOG_SCALE)
    put_vec4(quat, state, first + _QUAT)
    state[first + _LOGIT] = opacity_logit


@wp.func
def parameters_at(state: wp.array[float], first: int):
    """Return what `put_parameters` wrote, in its order."""
    mean = vec3_at(state, first)
    log_scale = vec3_at(state, first + _LOG_SCALE)
    quat = vec4_at(state, first + _QUAT)
    return mean, log_scale, quat, state[first + _LOGIT]
