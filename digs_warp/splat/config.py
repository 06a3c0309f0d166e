"""Every constant of the splat engine, with its reason, and how its hot kernels are compiled."""

from dataclasses import dataclass
from typing import Literal, get_args

from digs_warp.checks import DigsError
from digs_warp.device.image_planes import ALIGNMENT

# Tiles are 16x16 pixels. The rasterizer evaluates a splat in blocks of 2 rows by 8 columns: one vector of
# float32 of 512 bits, or two of 256.
TILE_SIZE = ALIGNMENT
TILE_PIXELS = TILE_SIZE * TILE_SIZE
BLOCK_WIDTH = 8
BLOCK_HEIGHT = 2

# Pixel slack on the half extents of a splat, so that rounding never cuts off a pixel above the cut.
EXTENT_SLACK = 0.01

# The near plane as a share of the distance from the camera to the center of the scene.
NEAR_SHARE = 0.05

# A projected variance [px^2] above this is an overflow, not a splat: dropped.
MAX_VARIANCE = 1.0e12

# Color coefficients whose absolute values sum to more than this are an overflow: the splat is dropped.
MAX_COLOR = 1.0e9

# As in the 3DGS reference: a smaller alpha is not drawn, which bounds the area that a splat touches; a larger
# one is capped, because the backward pass divides by 1 - alpha; and a pixel whose transmittance would fall
# below the least stops: that splat and all behind it are not drawn. The exponential of the hot loops is a
# polynomial for exponents down to ln(1/255).
MIN_ALPHA = 1.0 / 255.0
MAX_ALPHA = 0.99
MIN_TRANSMITTANCE = 1.0e-4

# The Jacobian of the projection is evaluated at most this many half-widths outside of the image: further out
# the linearization blows up.
JACOBIAN_MARGIN = 0.3

# How far the skin of a splat lies before its center [standard deviations]; see `digs_warp.splat.project`.
# With it, the surface without a depth term is least biased: see docs/training.md.
REACH = 2.0

# The antialiasing factor sqrt(det / det') is held above this, and so is its derivative, which grows without
# bound for a splat that degenerates to a line (the floor of the 3DGS reference, sqrt(2.5e-5)).
MIN_COMPENSATION = 0.005

# Dilation of the image of what our training makes [px^2], a tenth of a pixel: below, float32 cannot tell the
# gradient of a needle that is thinner than that. It changes an image by less than .01 dB.
DILATION = 0.01

Outputs = Literal["color", "mean depth", "depth"]
DepthOf = Literal["center", "skin"]

# The channels of rendered depth.
EXPECTED, MEDIAN = 0, 1


@dataclass(frozen=True)
class RasterOptions:
    """How splats are drawn.

    Attributes:
        dilation: added to the diagonal of the projected covariance [px^2]. What our training makes is drawn
            without (`digs_warp.train.smoothing`); the little that is left keeps the inverse of the
            covariance of an infinitely thin splat finite. Scenes of 3DGS are made for 0.3.
        antialias: scale the opacity by sqrt(det / det') of the covariance before and after the dilation
            (Mip-Splatting), so that a splat smaller than a pixel does not gain weight. Scenes trained with it
            must be drawn with it.
        outputs: what a view gives beside color and transmittance: "color" nothing, "mean depth" the expected
            depth, "depth" the median depth as well. Each costs time only when asked for. Any value per
            Gaussian, such as a normal, can be drawn as its color.
        depth_of: the place of a splat that its depth is that of: its "center", or its "skin", which is what a
            depth camera measures (`digs_warp.splat.project`).
    """

    dilation: float = DILATION
    antialias: bool = False
    outputs: Outputs = "color"
    depth_of: DepthOf = "center"

    def __post_init__(self) -> None:
        """Raise a `DigsError` for a value outside of its range."""
        if not 1.0e-3 <= self.dilation <= 100.0:
            raise DigsError(f"raster option dilation: {self.dilation}, expected 0.001 to 100")
        for name, known in (("outputs", Outputs), ("depth_of", DepthOf)):
            if getattr(self, name) not in get_args(known):
                expected = ", ".join(get_args(known))
                raise DigsError(
                    f"raster option {name}: {getattr(self, name)!r}, expected {expected}"
                )

    @property
    def has_depth(self) -> bool:
        """Whether views give depths."""
        return self.outputs != "color"

    @property
    def depth_channels(self) -> int:
        """How many depths views give, in the order of `EXPECTED`, `MEDIAN`."""
        return {"color": 0, "mean depth": 1}.get(self.outputs, 2)


DEFAULT_OPTIONS = RasterOptions()
