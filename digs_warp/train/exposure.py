"""Exposure and white balance of each photograph, so that the colors of the Gaussians are those of all.

A camera that adapts to the light shows the same surface brighter in one photograph than in another. Before
each step, the gain of the step's view follows in closed form from its rendering and its photograph; the loss
compares the rendering with the photograph without that gain. The mean of the logarithms over the views is 0:
a gain of all views together would only move the colors of the Gaussians.

Where the exposure is constant, the gains found are errors of the model: shading that it does not show yet.
They are shrunk by the share of their mean square that such errors explain, so a constant exposure stays one.

The same holds for the lift of each photograph (`digs_warp.measure.color_lift`): where the camera changes its
contrast or its black level, too, the gains are those of the photographs without their lifts. While the
Gaussians still learn the contrast of the scene, a lift shows how far they are: how much it changes from one
visit of its view to the next tells that error.
"""

from dataclasses import dataclass

import numpy as np

from digs_warp.checks import check_shape
from digs_warp.measure.color_gain import STOPS_PER_LOG, ColorGain, fit_color_gain
from digs_warp.measure.color_lift import NOISE_LIFT, fit_lift, trusted_share
from digs_warp.splat.blur_renderer import BlurRenderer

# Pixels of a view that its gain follows from, spread over the object.
MOST_SAMPLES = 4096
# Every how many of them tell its lift: all channels do together, and all cores wait for it in every step.
LIFT_SAMPLES = 4
# Share by which a visit moves the lift of its view towards the one found. At one half, the mean square of
# these changes is that of the errors left: of noise that differs from visit to visit, a third is left and a
# third is in the changes; of an error that a visit halves, one half and one half.
LIFT_RATE = 0.5
# Where more of the background shows through, a pixel does not tell the color of the Gaussians.
MOST_TRANSPARENT = 0.05
# Gains of photographs with constant exposure come out this large [stops], root mean square: 0.021 on the cow
# "spot" of the sample data after 300 steps.
NOISE_STOPS = 0.03
# Masks of networks rarely reach 255.
INSIDE = 250


@dataclass(frozen=True, eq=False)
class ColorSamples:
    """Some pixels of a photograph that belong to the object entirely.

    Attributes:
        columns, rows: which, shape (k,).
        colors: sRGB in 0..1, shape (k, 3), float32.
    """

    columns: np.ndarray
    rows: np.ndarray
    colors: np.ndarray

    @property
    def bytes(self) -> int:
        """Memory of the samples [bytes]."""
        return self.columns.nbytes + self.rows.nbytes + self.colors.nbytes

    @staticmethod
    def of(image: np.ndarray, mask: np.ndarray) -> "ColorSamples":
        """Return at most `MOST_SAMPLES`, evenly spread; image (h, w, 3) and mask (h, w) are uint8."""
        rows, columns = np.nonzero(mask >= INSIDE)
        step = max(1, -(-len(rows) // MOST_SAMPLES))
        rows, columns = rows[::step], columns[::step]
        return ColorSamples(columns, rows, image[rows, columns].astype(np.float32) / 255.0)


class Exposures:
    """The gains and lifts of all training views.

    Args:
        count: number of views.
        constant: whether exposure and tone are known to be constant; nothing is fitted then.

    Attributes:
        log_factors: see `ColorGain`, shape (count, 3); 0 for views that were not fitted.
        lifts: smoothed over the visits, shape (count,); 0 for views that were not fitted.
        changes: of the lifts at the last visit to their views, shape (count,).
        fitted: which views were fitted, shape (count,).
    """

    def __init__(self, count: int, constant: bool = False) -> None:
        self.constant = constant
        self.log_factors = np.zeros((count, 3))
        self.lifts = np.zeros(count)
        self.changes = np.zeros(count)
        self.fitted = np.zeros(count, dtype=bool)

    def fit(self, index: int, colors: np.ndarray, photograph: np.ndarray) -> ColorGain | None:
        """Fit a view again, and return its gain; None while gains and lifts are no larger than their errors.

        Args:
            index: of the view.
            colors: rendered sRGB values, shape (k, 3).
            photograph: those of the photograph, in 0..1, shape (k, 3).
        """
        if self.constant:
            return None
        some = slice(None, None, LIFT_SAMPLES)
        before = float(self.lifts[index])
        self.changes[index] = LIFT_RATE * (
            fit_lift(colors[some], photograph[some], before) - before
        )
        self.lifts[index] += self.changes[index]
        self.fitted[index] = True
        self.lifts[self.fitted] -= self.lifts[self.fitted].mean()
        lift = self.lift_share * float(self.lifts[index])
        found = fit_color_gain(colors, photograph, self.log_factors[index], lift)
        self.log_factors[index] = found.log_factors
        self.log_factors[self.fitted] -= self.log_factors[self.fitted].mean(axis=0)
        share = self.trusted_share
        if share <= 0 and lift == 0:
            return None
        return ColorGain(share * self.log_factors[index], lift)

    @property
    def rms_stops(self) -> float:
        """Root mean square of the gains of the views fitted so far [stops]; 0 for none."""
        found = self.log_factors[self.fitted]
        return float(np.sqrt(np.mean(found**2))) * STOPS_PER_LOG if len(found) else 0.0

    @property
    def trusted_share(self) -> float:
        """The share of the gains that their errors do not explain, 0 to 1 (James and Stein)."""
        return trusted_share(self.rms_stops**2, NOISE_STOPS**2)

    @property
    def lift_share(self) -> float:
        """The share of the lifts that their errors do not explain, 0 to 1; 0: the tone is constant."""
        if not self.fitted.any():
            return 0.0
        lifts, changes = self.lifts[self.fitted], self.changes[self.fitted]
        error = NOISE_LIFT**2 + float(np.mean(changes**2))
        return trusted_share(float(np.mean(lifts**2)), error)

    @property
    def rms_lift(self) -> float:
        """Root mean square of the lifts that are taken off [sRGB, 0 to 1]; 0 where the tone is constant."""
        found = self.lift_share * self.lifts[self.fitted]
        return float(np.sqrt(np.mean(found**2))) if len(found) else 0.0

    def state(self) -> dict[str, np.ndarray]:
        """Return what a checkpoint has to hold."""
        return {
            "log_factors": self.log_factors,
            "lifts": self.lifts,
            "changes": self.changes,
            "fitted": self.fitted,
        }

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Continue from `state`.

        Raises:
            DigsError: it belongs to another number of views.
        """
        count = len(self.fitted)
        self.log_factors = check_shape("log_factors", state["log_factors"], (count, 3)).copy()
        self.lifts = check_shape("lifts", state["lifts"], (count,)).copy()
        self.changes = check_shape("changes", state["changes"], (count,)).copy()
        self.fitted = check_shape("fitted", state["fitted"], (count,)).astype(bool)


def rendered_samples(
    renderer: BlurRenderer, samples: ColorSamples
) -> tuple[np.ndarray, np.ndarray]:
    """Return rendered sRGB values (k, 3) and those of the photograph (k, 3), where Gaussians are opaque."""
    image, transmittance = renderer.image, renderer.transmittance
    at = image.origin + samples.rows * image.pitch + samples.columns
    opaque = transmittance.data.numpy()[at] <= MOST_TRANSPARENT
    at = at[opaque]
    values = image.data.numpy()
    colors = np.stack([values[at + channel * image.plane] for channel in range(3)], axis=1)
    return colors, samples.colors[opaque]
