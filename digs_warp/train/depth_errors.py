"""What is wrong with measured depth, as the photographs tell: an offset of its disparity, and its noise.

A drifted calibration moves a whole surface by millimeters to centimeters, by the same in every frame, so
averaging does not remove it. But the photographs contradict it: they put the surface where their rays meet.
After each rendering, the offset of its view is the median of 1/d - 1/z (d measured, z rendered); that of the
recording is the median over the views. The depth term compares with the depth without it: it holds the shape.

Where depth has no offset, those found are errors of the model, whose surface lies a little off before the
depth term has pulled it to its place. They are shrunk by the share of their square that such errors explain.

The spread around the offset is the noise of the depth. The weight of the depth falls with its square where it
exceeds that of a good camera: noise of several pixels' width, as in small images, is no help to photographs.
"""

from dataclasses import dataclass

import numpy as np

from digs_warp.checks import check_shape
from digs_warp.splat.config import EXPECTED
from digs_warp.splat.renderer import SplatRenderer

# Pixels of a view that its offset follows from, spread over the object.
MOST_SAMPLES = 2048
# Where more of the background shows through, a pixel does not tell the depth of the surface.
MOST_TRANSPARENT = 0.5
# The fewest pixels that a view is judged by.
FEWEST_PIXELS = 16
# The surface without a depth term is this far from unbiased depth, as a share of the distance: 0.2 % on the
# cow "spot" of the sample data (320x180, 300 steps), less on other objects.
NOISE_SHARE = 0.003
# Noise of the depth up to which it has its full weight, as a share of the distance.
TRUSTED_SPREAD = 0.003
# A larger offset [share of the distance] is no drift.
MOST_SHARE = 0.02


@dataclass(frozen=True, eq=False)
class DepthSamples:
    """Some pixels of a view at which depth was measured.

    Attributes:
        columns, rows: which, shape (k,).
        depths: measured [m], shape (k,), float32.
    """

    columns: np.ndarray
    rows: np.ndarray
    depths: np.ndarray

    @property
    def bytes(self) -> int:
        """Memory of the samples [bytes]."""
        return self.columns.nbytes + self.rows.nbytes + self.depths.nbytes

    @staticmethod
    def of(depth: np.ndarray, weights: np.ndarray) -> "DepthSamples":
        """Return at most `MOST_SAMPLES` of depth [m] and its weights, both (height, width); evenly spread."""
        rows, columns = np.nonzero(weights)
        step = max(1, -(-len(rows) // MOST_SAMPLES))
        rows, columns = rows[::step], columns[::step]
        return DepthSamples(columns, rows, depth[rows, columns].astype(np.float32))


@dataclass(frozen=True)
class DepthErrors:
    """The errors of a recording's depth.

    Attributes:
        offset: by how much measured inverse depth is too large [1/m]; 0 where that is no more than errors of
            the model.
        trust: factor on the weight of the depth, 0 to 1.
    """

    offset: float = 0.0
    trust: float = 1.0


NO_ERRORS = DepthErrors()


class DepthJudge:
    """Finds the errors of the recording's depth, view by view.

    Args:
        count: number of views.

    Attributes:
        offsets: of each view, as a share of its distance, shape (count,); 0 for those that were not fitted.
        spreads: median distance of each view's errors from its offset, likewise.
        distances: median depth of each view [m], likewise.
    """

    def __init__(self, count: int) -> None:
        self.offsets = np.zeros(count)
        self.spreads = np.zeros(count)
        self.distances = np.zeros(count)

    def fit(self, index: int, rendered: np.ndarray, measured: np.ndarray) -> DepthErrors:
        """Fit a view again, and return what is known of the recording.

        Args:
            index: of the view.
            rendered: depths [m], shape (k,), above 0.
            measured: those of the same pixels [m], shape (k,).
        """
        if len(rendered) >= FEWEST_PIXELS:
            measured = measured.astype(np.float64)
            distance = float(np.median(measured))
            errors = distance * (1.0 / measured - 1.0 / rendered)
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
        trust = min(1.0, (TRUSTED_SPREAD / max(spread, TRUSTED_SPREAD)) ** 2)
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


def rendered_depths(
    renderer: SplatRenderer, samples: DepthSamples
) -> tuple[np.ndarray, np.ndarray]:
    """Return rendered and measured depths [m], (k,) each, where the Gaussians cover the pixel by half."""
    depth, transmittance = renderer.depth, renderer.transmittance
    at = depth.origin + samples.rows * depth.pitch + samples.columns
    drawn = depth.data.numpy()[EXPECTED * depth.plane + at].astype(np.float64)
    seen = (transmittance.data.numpy()[at] <= MOST_TRANSPARENT) & (drawn > 0)
    return drawn[seen], samples.depths[seen]
