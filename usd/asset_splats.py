"""Gaussians as they are stored in a scene: activated, in the asset's frame, in a chosen precision."""

from dataclasses import dataclass
from typing import Literal

from digs_warp.data.gaussians import Gaussians
from digs_warp.usd.convert import (
    Precision,
    SplatArrays,
    arrays_from_gaussians,
    transformed,
    with_precision,
    with_sh_degree,
)
from digs_warp.usd.frames import ASSET_FROM_WORLD, similarity_from_matrix

_ASSET_FROM_WORLD = similarity_from_matrix(ASSET_FROM_WORLD, "asset")


@dataclass(frozen=True, kw_only=True)
class WriteOptions:
    """How Gaussians are stored in a USD scene."""

    precision: Precision = "float"
    """float keeps every digit; mixed halves all but the positions, which halves the file at no visible
    loss; half also rounds positions (to 0.5 mm at 1 m), and some importers do not read it."""

    sh_degree: Literal[0, 1, 2, 3] | None = None
    """Degree of the spherical harmonics in the file: higher bands are left out, missing ones are zero.
    Without it the file has the degree of the training."""


def asset_arrays(
    gaussians: Gaussians, options: WriteOptions, what: str = "Gaussians"
) -> SplatArrays:
    """Return Gaussians as they are stored: activated, in the asset's frame, in the chosen precision.

    Raises:
        UsdError: NaN or infinite values, or values beyond the chosen precision; names ``what``.
    """
    arrays = arrays_from_gaussians(gaussians, what)
    if options.sh_degree is not None:
        arrays = with_sh_degree(arrays, options.sh_degree)
    arrays = transformed(arrays, _ASSET_FROM_WORLD)
    return with_precision(arrays, options.precision, what)
