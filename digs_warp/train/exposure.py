"""Exposure and white balance of each photograph, so that the colors of the Gaussians are those of all.

A camera that adapts to the light shows the same surface brighter in one photograph than in another. Before
each step, the gain of the step's view follows in closed form from its rendering and its photograph; the loss
compares the rendering with the photograph without that gain. The mean of the logarithms over the views is 0:
a gain of all views together would only move the colors of the Gaussians.

Where the exposure is constant, the gains found are errors of the model: shading that it does not show yet.
They are shrunk by the share of their mean square that such errors explain, so a constant exposure stays one.
"""

from dataclasses import dataclass, replace

import numpy as np

from digs_warp.checks import check_shape
from digs_warp.device.image_planes import ImagePlanes
from digs_warp.measure.color_gain import STOPS_PER_LOG, ColorGain, fit_color_gain, trusted_share
from digs_warp.splat.blur_renderer import BlurRenderer

# Pixels of a view that its gain follows from, spread over the object.
MOST_SAMPLES = 4096
# Where more of the background shows through, a pixel does not tell the color of the Gaussians.
MOST_TRANSPARENT = 0.05
# Gains of photographs with constant exposure come out this large [stops], root mean square: 0.021 on the cow
# "spot" of the sample data after 300 steps.
NOISE_STOPS = 0.03
# Masks of networks rarely reach 255.
INSIDE = 250


@dataclass(frozen=True, eq=False)
class Samples:
    """Some pixels of a view.

    Attributes:
        columns, rows: which, shape (k,).
        values: colors, sRGB in 0..1, (k, 3), or measured depths [m], (k,); float32.
    """

    columns: np.ndarray
    rows: np.ndarray
    values: np.ndarray

    @property
    def bytes(self) -> int:
        """Memory of the samples [bytes]."""
        return self.columns.nbytes + self.rows.nbytes + self.values.nbytes

    @staticmethod
    def of(values: np.ndarray, chosen: np.ndarray, most: int) -> "Samples":
        """Return at most so many of the chosen pixels (height, width), evenly spread."""
        rows, columns = np.nonzero(chosen)
        step = max(1, -(-len(rows) // most))
        rows, columns = rows[::step], columns[::step]
        return Samples(columns, rows, values[rows, columns].astype(np.float32))

    def places(self, planes: ImagePlanes) -> np.ndarray:
        """Return the indices of the pixels in the first of the planes."""
        return planes.origin + self.rows * planes.pitch + self.columns


def color_samples(image: np.ndarray, mask: np.ndarray) -> Samples:
    """Return colors of pixels of the object alone; image (height, width, 3) and mask are uint8."""
    found = Samples.of(image, mask >= INSIDE, MOST_SAMPLES)
    return replace(found, values=found.values / 255.0)


class Exposures:
    """The gains of all training views.

    Args:
        count: number of views.
        constant: whether the exposure is known to be constant; nothing is fitted then.

    Attributes:
        log_factors: see `ColorGain`, shape (count, 3); 0 for views that were not fitted.
        fitted: which views were fitted, shape (count,).
    """

    def __init__(self, count: int, constant: bool = False) -> None:
        self.constant = constant
        self.log_factors = np.zeros((count, 3))
        self.fitted = np.zeros(count, dtype=bool)

    def fit(self, index: int, colors: np.ndarray, photograph: np.ndarray) -> ColorGain | None:
        """Fit a view again, and return its gain; None while the gains are no larger than their errors.

        Args:
            index: of the view.
            colors: rendered sRGB values, shape (k, 3).
            photograph: those of the photograph, in 0..1, shape (k, 3).
        """
        if self.constant:
            return None
        self.fitted[index] = True
        found = fit_color_gain(colors, photograph, self.log_factors[index])
        self.log_factors[index] = found.log_factors
        self.log_factors[self.fitted] -= self.log_factors[self.fitted].mean(axis=0)
        share = self.trusted_share
        return ColorGain(share * self.log_factors[index]) if share > 0 else None

    @property
    def rms_stops(self) -> float:
        """Root mean square of the gains of the views fitted so far [stops]; 0 for none."""
        found = self.log_factors[self.fitted]
        return float(np.sqrt(np.mean(found**2))) * STOPS_PER_LOG if len(found) else 0.0

    @property
    def trusted_share(self) -> float:
        """The share of the gains that their errors do not explain, 0 to 1 (James and Stein)."""
        return trusted_share(self.rms_stops**2, NOISE_STOPS**2)

    def state(self) -> dict[str, np.ndarray]:
        """Return what a checkpoint has to hold."""
        return {
            "log_factors": self.log_factors,
            "fitted": self.fitted,
        }

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Continue from `state`.

        Raises:
            DigsError: it belongs to another number of views.
        """
        count = len(self.fitted)
        self.log_factors = check_shape("log_factors", state["log_factors"], (count, 3)).copy()
        self.fitted = check_shape("fitted", state["fitted"], (count,)).astype(bool)


def rendered_samples(renderer: BlurRenderer, samples: Samples) -> tuple[np.ndarray, np.ndarray]:
    """Return rendered sRGB values (k, 3) and those of the photograph (k, 3), where Gaussians are opaque."""
    image, transmittance = renderer.image, renderer.transmittance
    at = samples.places(image)
    opaque = transmittance.data.numpy()[at] <= MOST_TRANSPARENT
    at = at[opaque]
    values = image.data.numpy()
    colors = np.stack([values[at + channel * image.plane] for channel in range(3)], axis=1)
    return colors, samples.values[opaque]
