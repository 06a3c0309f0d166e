"""The Gaussians of a scene: raw parameters for the optimizer, activated values for a renderer."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path

import numpy as np

from digs_warp.checks import DigsError, check_shape
from digs_warp.geometry.sh import degree_from_count
from digs_warp.record.arrays import open_arrays, write_arrays

FIELDS = ("means", "log_scales", "quats", "opacity_logits", "sh")

# The widest dilation that a file may ask for [px^2]: a standard deviation of ten pixels.
MOST_DILATION = 100.0

_NOTE = "screen_filter"

# Other formats are floors above, and are loaded by name when they are asked for.
OTHER_FORMATS = "digs_warp.pipeline.scene_files"


@dataclass(frozen=True)
class ScreenFilter:
    """What a renderer has to do to splats on the screen, because they were trained with it.

    It is of one size in pixels at every distance, so that such splats look right near the image size that
    they were trained at only.

    Attributes:
        dilation: added to the diagonal of each splat's covariance on the image [px^2], 0 to `MOST_DILATION`.
        antialias: scale the opacity by sqrt(det / det') of the covariance before and after the dilation.
    """

    dilation: float = 0.0
    antialias: bool = False

    def __post_init__(self) -> None:
        if not 0.0 <= self.dilation <= MOST_DILATION:
            raise DigsError(
                f"screen filter: dilation {self.dilation} px^2, expected 0 to {MOST_DILATION:g}"
            )


# Our own scenes, the particle fields of USD, ray tracers.
NO_FILTER = ScreenFilter()
# 3D Gaussian splatting (2023) and nearly every viewer.
CLASSIC = ScreenFilter(0.3)
# Mip-Splatting, "antialiased" of gsplat, and "mip" of splat-transform.
ANTIALIASED = ScreenFilter(0.3, antialias=True)


@dataclass(frozen=True, eq=False)
class Gaussians:
    """Raw, optimized parameters of n Gaussians, all float32.

    Attributes:
        means: centers in the world [m], shape (n, 3).
        log_scales: natural logarithm of the standard deviations [m] along the local axes, (n, 3).
        quats: rotations world-from-local, xyzw, not normalized, (n, 4); zero means no rotation.
        opacity_logits: logit of the opacity, (n,).
        sh: spherical-harmonics coefficients of the color in sRGB, (n, K, 3), see `digs_warp.geometry.sh`.
        screen_filter: what they are drawn with.
    """

    means: np.ndarray
    log_scales: np.ndarray
    quats: np.ndarray
    opacity_logits: np.ndarray
    sh: np.ndarray
    screen_filter: ScreenFilter = field(default=NO_FILTER, kw_only=True)

    def __post_init__(self) -> None:
        for name in FIELDS:
            value = np.ascontiguousarray(getattr(self, name), dtype=np.float32)
            object.__setattr__(self, name, value)
        count = len(self.means)
        check_shape("Gaussians.means", self.means, (count, 3))
        check_shape("Gaussians.log_scales", self.log_scales, (count, 3))
        check_shape("Gaussians.quats", self.quats, (count, 4))
        check_shape("Gaussians.opacity_logits", self.opacity_logits, (count,))
        check_shape("Gaussians.sh", self.sh, (count, None, 3))
        degree_from_count(self.sh.shape[1])

    def __len__(self) -> int:
        return len(self.means)

    @property
    def sh_degree(self) -> int:
        """Degree of the spherical harmonics, 0 to 3."""
        return degree_from_count(self.sh.shape[1])

    @property
    def scales(self) -> np.ndarray:
        """Standard deviations [m], shape (n, 3)."""
        return np.exp(self.log_scales)

    @property
    def opacities(self) -> np.ndarray:
        """Opacities in 0..1, shape (n,)."""
        from scipy.special import expit  # imported here to keep `digs-warp --help` fast

        return expit(self.opacity_logits.astype(np.float64)).astype(np.float32)

    def select(self, keep: np.ndarray | slice) -> "Gaussians":
        """Return the Gaussians at ``keep``: a bool mask, (n,), indices, or a slice (a view)."""
        return replace(self, **{name: getattr(self, name)[keep] for name in FIELDS})

    def save(self, path: Path) -> None:
        """Write a file, complete or not at all.

        By its suffix it is an ``.npz`` with one array per field, or PLY, SPZ, .splat or USD.

        Raises:
            DigsError: another suffix, values that the format cannot hold, or the file cannot be written.
        """
        path = Path(path)
        if path.suffix.lower() != ".npz":
            import_module(OTHER_FORMATS).save_gaussians(path, self)
            return
        arrays = {name: getattr(self, name) for name in FIELDS}
        note = np.array([self.screen_filter.dilation, self.screen_filter.antialias])
        write_arrays(path, arrays | {_NOTE: note})

    @staticmethod
    def load(path: Path) -> "Gaussians":
        """Read a file that `save` wrote. An ``.npz`` without a note of the filter is older: `CLASSIC`.

        Raises:
            DigsError: the file is missing, truncated, or lacks a field.
        """
        path = Path(path)
        if path.suffix.lower() != ".npz":
            return import_module(OTHER_FORMATS).read_scene(path).gaussians
        with open_arrays(path, "Gaussians", FIELDS) as arrays:
            found = CLASSIC
            if _NOTE in arrays:
                dilation, antialias = check_shape(_NOTE, arrays[_NOTE], (2,)).tolist()
                found = ScreenFilter(dilation, bool(antialias))
            return Gaussians(**{name: arrays[name] for name in FIELDS}, screen_filter=found)


def joined(parts: Sequence[Gaussians]) -> Gaussians:
    """Return all Gaussians of one or more parts; lower degrees of the color are filled up with zeros.

    Raises:
        DigsError: the parts are drawn with different filters.
    """
    filters = {part.screen_filter for part in parts}
    if len(filters) > 1:
        raise DigsError(f"Gaussians for different renderers cannot be one set: {filters}")
    bands = max(part.sh.shape[1] for part in parts)
    sh = [np.pad(part.sh, ((0, 0), (0, bands - part.sh.shape[1]), (0, 0))) for part in parts]
    columns = {
        name: np.concatenate([getattr(each, name) for each in parts]) for name in FIELDS[:-1]
    }
    return replace(parts[0], **columns, sh=np.concatenate(sh))
