"""How many Gaussians a run may hold: a cap given as a number or as memory."""

from digs_warp.checks import DigsError
from digs_warp.geometry.sh import coefficient_count

# Floats per Gaussian without its color: center, scales, rotation, opacity.
_SHAPE_FLOATS = 3 + 3 + 4 + 1
# Each parameter has a value, a gradient and two moments.
_COPIES = 4
# The renderer's lists: 12 floats and eight integers per splat, and about three (tile, splat) pairs of nine
# gradients and two integers each, with spare capacity to grow into.
_LIST_BYTES = 4 * (12 + 8) + 4 * 3 * (9 + 2) * 3 // 2

_MEGABYTE = 2**20


def bytes_per_splat(sh_degree: int) -> int:
    """Return the memory [bytes] that one Gaussian takes during training, without images."""
    floats = _SHAPE_FLOATS + 3 * coefficient_count(sh_degree)
    return 4 * _COPIES * floats + _LIST_BYTES


def splat_cap(max_splats: int, memory_budget: float | None, sh_degree: int) -> int:
    """Return the smaller of ``max_splats`` and what fits into ``memory_budget`` [MiB]; None: no budget."""
    if memory_budget is None:
        return max_splats
    return min(max_splats, int(memory_budget * _MEGABYTE) // bytes_per_splat(sh_degree))


def check_start(count: int, cap: int) -> None:
    """Raise a `DigsError` when a run starts with more Gaussians than it may hold."""
    if count > cap:
        raise DigsError(
            f"training: starts with {count:,} Gaussians, but --max-splats and splat_memory allow only "
            f"{cap:,}; raise them, or start with fewer points (a larger --voxel-size)"
        )
