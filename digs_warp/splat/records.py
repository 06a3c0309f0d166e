"""What a projected splat and the gradient of one (tile, splat) pair look like in memory."""

from dataclasses import dataclass

import warp as wp

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
SPLAT_HALF_WIDTH = wp.constant(9)  # half extents [px] of the area with alpha >= min_alpha
SPLAT_HALF_HEIGHT = wp.constant(10)
SPLAT_TAU = wp.constant(11)  # 2 ln(opacity / min_alpha): squared Mahalanobis radius of that area
# In the column dx off the centre, that area is slope dx -+ sqrt(chord - taper dx^2); it reaches furthest up
# and down on the image at dx = -peak and peak.
SPLAT_SLOPE = wp.constant(12)
SPLAT_CHORD = wp.constant(13)
SPLAT_TAPER = wp.constant(14)
SPLAT_PEAK = wp.constant(15)
SPLAT_FIELDS = 16  # one cache line

# d/d u, v, A, B, C, opacity, red, green, blue: the first columns of every gradient record.
COLOR_FIELDS = 9


@dataclass(frozen=True)
class GradientLayout:
    """Columns of the gradient record of one (tile, splat) pair; -1 where a view has no such output.

    Attributes:
        depth: first column of d/d depth.
        normal: first of three columns of d/d normal.
        absolute: first of two columns of the sums of |d/du| and |d/dv| over pixels.
        fields: number of columns.
    """

    depth: int
    normal: int
    absolute: int
    fields: int

    @staticmethod
    def of(with_depth: bool, with_normals: bool, with_absolute: bool) -> "GradientLayout":
        """Return the columns for a set of outputs."""
        normal = COLOR_FIELDS + with_depth
        absolute = normal + 3 * with_normals
        return GradientLayout(
            depth=COLOR_FIELDS if with_depth else -1,
            normal=normal if with_normals else -1,
            absolute=absolute if with_absolute else -1,
            fields=absolute + 2 * with_absolute,
        )
