"""What is wrong with measured depth, as the photographs tell: an offset of disparity, and errors of regions.

A drifted calibration moves a whole surface by millimeters to centimeters, by the same in every frame, so
averaging does not remove it. Highlights and faint texture move parts of it, and neighboring pixels together.
But the photographs contradict both: they put the surface where their rays meet.

After each rendering, the errors of its view are 1/d - 1/z (d measured, z rendered), and their medians in
cells of the image those of regions. The offset of the view is the median of the cells; that of the recording
is the median over the views. The depth term compares with the depth without it: it holds the shape.

Where depth has no offset, those found are errors of the model, whose surface lies a little off before the
depth term has pulled it to its place. They are shrunk by the share of their square that such errors explain.

How far the cells spread around the offset tells whether depth or photographs know the shape better: noise of
single pixels averages out over the views, errors of regions do not. From a spread that photographs have, too,
the weight of the depth falls with its square.
"""

from dataclasses import dataclass

import numpy as np

from digs_warp.checks import check_shape
from digs_warp.splat.config import EXPECTED
from digs_warp.splat.renderer import SplatRenderer
from digs_warp.train.exposure import Samples

# Pixels of a view that its offset follows from, spread over the object.
MOST_SAMPLES = 2048
# Where more of the background shows through, a pixel does not tell the depth of the surface.
MOST_TRANSPARENT = 0.5
# Cells along each side of the box of the object: about as wide as the errors of a matcher's window.
CELLS = 12
# The fewest samples that a cell is judged by.
FEWEST_PIXELS = 8
# The surface without a depth term is this far from unbiased depth, as a share of the distance.
NOISE_SHARE = 0.001
# Spread of the cells up to which depth has its full weight, as a share of the distance: for an object, which
# the photographs show from all sides, and for a scene, of whose plain walls they tell less.
TRUSTED_SPREAD, TRUSTED_IN_SCENES = 0.001, 0.003
# A larger offset [share of the distance] is no drift.
MOST_SHARE = 0.02


def depth_samples(depth: np.ndarray, weights: np.ndarray) -> Samples:
    """Return some of the depth [m] where the weights are not 0, both (height, width)."""
    return Samples.of(depth, weights, MOST_SAMPLES)


def cells_of(samples: Samples) -> np.ndarray:
    """Return the number of the cell that each sample lies in, shape (k,)."""
    return CELLS * _shares(samples.rows) + _shares(samples.columns)


@dataclass(frozen=True)
class DepthErrors:
    """The errors of a recording's depth."""

    # By how much measured inverse depth is too large [1/m]; 0 where that is no more than the model's errors.
    offset: float = 0.0
    trust: float = 1.0  # factor on the weight of the depth, 0 to 1


NO_ERRORS = DepthErrors()


class DepthJudge:
    """Finds the errors of the recording's depth, view by view.

    Args:
        count: number of views.
        trusted: spread of the cells up to which depth has its full weight, as a share of the distance.

    Attributes:
        offsets: of each view, as a share of its distance, shape (count,); 0 for those that were not fitted.
        spreads: median distance of the errors of its cells from its offset, likewise.
        distances: median depth of each view [m], likewise.
    """

    def __init__(self, count: int, trusted: float = TRUSTED_SPREAD) -> None:
        self._trusted = trusted
        self.offsets = np.zeros(count)
        self.spreads = np.zeros(count)
        self.distances = np.zeros(count)

    def fit(
        self, index: int, rendered: np.ndarray, measured: np.ndarray, cells: np.ndarray
    ) -> DepthErrors:
        """Fit a view again, and return what is known of the recording.

        Args:
            index: of the view.
            rendered: depths [m], shape (k,), above 0.
            measured: those of the same pixels [m], shape (k,).
            cells: numbers of the cells that these lie in, shape (k,).
        """
        measured = measured.astype(np.float64)
        errors = cell_medians(1.0 / measured - 1.0 / rendered, cells)
        if len(errors):
            distance = float(np.median(measured))
            errors *= distance
            self.distances[index] = distance
            self.offsets[index] = np.median(errors)
            self.spreads[index] = np.median(np.abs(errors - self.offsets[index]))
        return self.errors

    @property
    def errors(self) -> DepthErrors:
        """What the views fitted so far say together."""
        fitted = self.distances > 0
        if not fitted.any():
            return NO_ERRORS
        found = float(np.median(self.offsets[fitted]))
        share = min(max(found, -MOST_SHARE), MOST_SHARE)
        sure = max(0.0, 1.0 - (NOISE_SHARE / max(abs(share), NOISE_SHARE)) ** 2)
        spread = float(np.median(self.spreads[fitted]))
        trust = min(1.0, (self._trusted / max(spread, self._trusted)) ** 2)
        return DepthErrors(sure * share / float(np.median(self.distances[fitted])), trust)

    def state(self) -> dict[str, np.ndarray]:
        """Return what a checkpoint has to hold."""
        return {"offsets": self.offsets, "spreads": self.spreads, "distances": self.distances}

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Continue from `state`.

        Raises:
            DigsError: it belongs to another number of views.
        """
        for name, array in self.state().items():
            array[:] = check_shape(name, state[name], array.shape)


def cell_medians(values: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Return the upper median of each cell with `FEWEST_PIXELS` values or more, (cells,).

    Args:
        values: shape (k,).
        cells: numbers of their cells, shape (k,).
    """
    order = np.lexsort((values, cells))
    _, starts, counts = np.unique(cells[order], return_index=True, return_counts=True)
    known = counts >= FEWEST_PIXELS
    return values[order][(starts + counts // 2)[known]]


def rendered_depths(
    renderer: SplatRenderer, samples: Samples
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return rendered and measured depths [m] and cells, (k,) each, where Gaussians cover a pixel by half."""
    depth, transmittance = renderer.depth, renderer.transmittance
    at = samples.places(depth)
    drawn = depth.data.numpy()[EXPECTED * depth.plane + at].astype(np.float64)
    seen = (transmittance.data.numpy()[at] <= MOST_TRANSPARENT) & (drawn > 0)
    return drawn[seen], samples.values[seen], cells_of(samples)[seen]


def _shares(places: np.ndarray) -> np.ndarray:
    """Return in which of `CELLS` equal parts of their range the places lie, int64."""
    if not len(places):
        return places
    low = int(places.min())
    return CELLS * (places - low) // (int(places.max()) - low + 1)
