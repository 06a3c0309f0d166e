"""The Gaussians of a scene: raw parameters for the optimizer, activated values for a renderer."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path

import numpy as np

from digs_warp.checks import DigsError, check_shape
from digs_warp.geometry.sh import C0, degree_from_count
from digs_warp.record.arrays import open_arrays, write_arrays
from digs_warp.words import counted

FIELDS = ("means", "log_scales", "quats", "opacity_logits", "sh")

# The widest dilation that a file may ask for [px^2]: a standard deviation of ten pixels.
MOST_DILATION = 100.0

_NOTE, _OFFSET = "screen_filter", "world_offset"

# So many at one point, or so few in all, are no accident and no scene.
FEWEST_TO_DOUBT = 10
# Of the distance between neighbors on a surface; splats are about as wide as that.
MOST_OVERLAP = 3.0
# All scales of a scene are never between 1 and this, in no unit.
NARROW = 2.0
# Of opacities that were taken for logits: the largest, and the least spread, for new splats have one.
TOP_OF_ONE, LEAST_SPREAD = 0.7311, 0.01
# Half of the splats brighter than white, or darker than black, by more than this are no sRGB colors.
COLOR_MARGIN = 1.0
_HASH = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)

# Other formats and pictures are floors above, and are loaded by name when they are asked for.
OTHER_FORMATS = "digs_warp.pipeline.scene_files"
CARDS = "digs_warp.api.cards"


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


@dataclass(frozen=True, eq=False, repr=False)
class Gaussians:
    """Raw, optimized parameters of n Gaussians, all float32.

    Attributes:
        means: centers in the world [m], shape (n, 3).
        log_scales: natural logarithm of the standard deviations [m] along the local axes, (n, 3).
        quats: rotations world-from-local, xyzw, not normalized, (n, 4); zero means no rotation.
        opacity_logits: logit of the opacity, (n,).
        sh: spherical-harmonics coefficients of the color in sRGB, (n, K, 3), see `digs_warp.geometry.sh`.
        screen_filter: what they are drawn with.
        world_offset: what was taken off the centers of a scene far from the origin, which float32 cannot
            hold [m]; None: nothing.
    """

    means: np.ndarray
    log_scales: np.ndarray
    quats: np.ndarray
    opacity_logits: np.ndarray
    sh: np.ndarray
    screen_filter: ScreenFilter = field(default=NO_FILTER, kw_only=True)
    world_offset: tuple[float, float, float] | None = field(default=None, kw_only=True)

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

    def __repr__(self) -> str:
        sides = np.ptp(self.means, axis=0) if len(self) else np.zeros(3)
        extent = " x ".join(f"{side:.3g}" for side in sides)
        return f"<{counted(len(self), 'Gaussian')} of degree {self.sh_degree}, {extent} m>"

    def _repr_html_(self) -> str:
        return import_module(CARDS).gaussians_card(self)

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

    def less(self, world_offset: tuple[float, float, float] | None) -> "Gaussians":
        """Return them with this taken off their centers [m], as it was off the places of a recording."""
        if world_offset is None or self.world_offset is None:
            return self
        means = self.means + np.subtract(self.world_offset, world_offset)
        return replace(self, means=means, world_offset=world_offset)

    @property
    def doubts(self) -> list[str]:
        """Sentences about values that are probably not what was meant; see `doubts_of`."""
        with np.errstate(over="ignore"):
            values = (self.means, self.scales, self.opacities, self.sh[:, 0])
        return [sentence for _, sentence in doubts_of(*values)]

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
            import_module(OTHER_FORMATS).save_file(path, self)
            return
        arrays = {name: getattr(self, name) for name in FIELDS}
        note = np.array([self.screen_filter.dilation, self.screen_filter.antialias])
        offset = {} if self.world_offset is None else {_OFFSET: np.array(self.world_offset)}
        write_arrays(path, arrays | {_NOTE: note} | offset)

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
            offset = None
            if _OFFSET in arrays:
                offset = tuple(check_shape(_OFFSET, arrays[_OFFSET], (3,)).tolist())
            values = {name: arrays[name] for name in FIELDS}
            return Gaussians(**values, screen_filter=found, world_offset=offset)


def doubts_of(
    means: np.ndarray, scales: np.ndarray, opacities: np.ndarray, base: np.ndarray
) -> Iterator[tuple[str, str]]:
    """Yield (rule, sentence) for what finite, activated values look like when a program has erred.

    Args:
        means: centers, shape (n, 3).
        scales: standard deviations, shape (n, 3).
        opacities: shape (n,).
        base: coefficients of the color of degree 0, shape (n, 3).
    """
    count = len(means)
    if count < FEWEST_TO_DOUBT:
        return
    _, inverse, members = np.unique(
        np.ascontiguousarray(means, np.float32).view(np.uint32).astype(np.uint64) @ _HASH,
        return_inverse=True,
        return_counts=True,
    )
    first = int(np.argmax(members[inverse]))
    if (most := int(members.max())) >= FEWEST_TO_DOUBT:
        x, y, z = means[first].tolist()
        yield (
            "repeated",
            f"{most} of {count} lie at one point ({x:g}, {y:g}, {z:g}): rows of zeros?",
        )
    rest = members[inverse] < FEWEST_TO_DOUBT
    if not rest.any():
        return
    typical = float(np.median(scales[rest].max(axis=1)))
    whole = float(np.linalg.norm(np.ptp(means[rest], axis=0)))
    if typical > whole:
        yield (
            "scale-range",
            f"half of the splats are wider ({typical:.3g}) than the whole field ({whole:.3g})",
        )
    elif scales[rest].min() >= 1 and (
        typical < NARROW or typical > MOST_OVERLAP * whole / np.sqrt(rest.sum())
    ):
        yield (
            "scale-range",
            f"all splats are wider than 1, half of them up to {typical:.3g} in a field of {whole:.3g}: "
            "scales in metres that were taken for logarithms?",
        )
    low, high = float(opacities[rest].min()), float(opacities[rest].max())
    if low >= 0.5 and LEAST_SPREAD <= high - low and high <= TOP_OF_ONE:
        yield (
            "opacity-range",
            f"all opacities are {low:.3f} to {high:.3f}: values of 0 to 1 that were taken for logits?",
        )
    brightness = float(np.median(0.5 + C0 * base[rest].astype(np.float32).mean(axis=1)))
    if not -COLOR_MARGIN <= brightness <= 1 + COLOR_MARGIN:
        yield (
            "color-range",
            f"the median splat has a brightness of {brightness:.3g}, expected 0 to 1",
        )


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
