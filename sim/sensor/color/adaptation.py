"""How a camera's exposure and white balance follow the light, gradually.

The camera meters the mean color of the left image, in linear light and over the whole image. Exposure aims at
middle gray; white balance holds the world for gray on average and removes a share of the color cast. Both lag
behind: their logarithms x approach the target T exponentially,

    dx/dt = (T - x) / tau

A brighter picture takes a longer exposure, as far as the camera allows, and an electronic gain beyond that.
"""

from dataclasses import dataclass

import numpy as np

from digs_warp.sim.camera.rig import StereoRig

MIDDLE_GREY = 0.18  # linear; what exposure meters take for the mean of a scene (ISO 2720)

# Largest corrections of the recording's common exposure, and of red and blue against green [stops] [tuned].
MAX_EXPOSURE = 1.5
MAX_TINT = 1.0

LUMINANCE = np.array([0.2126, 0.7152, 0.0722], dtype=np.float32)  # Rec. 709

# The darkest mean color that a camera can meter; it is far beyond the limits above.
DARKEST = 1e-6

# A lag below this is none [s].
SHORTEST = 1e-9


@dataclass(frozen=True)
class Adaptation:
    """The settings at one moment, against the common exposure of the recording [stops].

    Attributes:
        exposure: of all channels.
        red: of red over green.
        blue: of blue over green.
    """

    exposure: float = 0.0
    red: float = 0.0
    blue: float = 0.0

    def scaled(self, strength: float) -> "Adaptation":
        """Return ``strength`` times the settings, within the limits of the camera."""
        return Adaptation(
            _limited(strength * self.exposure, MAX_EXPOSURE),
            _limited(strength * self.red, MAX_TINT),
            _limited(strength * self.blue, MAX_TINT),
        )

    @property
    def tint(self) -> tuple[float, float, float]:
        """Factors of the white balance on red, green and blue."""
        return 2.0**self.red, 1.0, 2.0**self.blue

    @property
    def color_gain(self) -> tuple[float, float, float]:
        """Factors on red, green and blue in linear light."""
        red, green, blue = (2.0**self.exposure * factor for factor in self.tint)
        return red, green, blue

    def longer_exposure(self, rig: StereoRig) -> float:
        """Return the factor on the exposure time."""
        return 2.0 ** min(self.exposure, rig.exposure_headroom)

    def electronic_gain(self, rig: StereoRig) -> float:
        """Return the gain that makes up for the exposure time that the camera does not have, >= 1."""
        return 2.0 ** max(self.exposure - rig.exposure_headroom, 0.0)


NOT_ADAPTED = Adaptation()


def targets(mean_colors: np.ndarray, rig: StereoRig) -> np.ndarray:
    """Return the exposure, red and blue that a camera aims at [stops], shape (n, 3).

    Args:
        mean_colors: metered, in linear light, shape (n, 3).
        rig: which share of a color cast its white balance removes.
    """
    colors = np.maximum(np.asarray(mean_colors, np.float64), DARKEST)
    exposure = np.log2(MIDDLE_GREY / (colors @ LUMINANCE))
    cast = np.log2(colors[:, [1]] / colors[:, [0, 2]])
    tint = np.clip(rig.white_balance * cast, -MAX_TINT, MAX_TINT)
    return np.column_stack([np.clip(exposure, -MAX_EXPOSURE, MAX_EXPOSURE), tint])


@dataclass(frozen=True, eq=False)
class AdaptationTrack:
    """The course of the settings; the targets are linear between the metered moments.

    Attributes:
        times: of the moments [s], ascending, shape (n,).
        aims: targets of exposure, red and blue at these times [stops], shape (n, 3).
        lags: time constants of the three [s], shape (3,).
        settings: what was reached at these times [stops], shape (n, 3).
    """

    times: np.ndarray
    aims: np.ndarray
    lags: np.ndarray
    settings: np.ndarray

    @staticmethod
    def following(times: np.ndarray, aims: np.ndarray, rig: StereoRig) -> "AdaptationTrack":
        """Return the track of a camera that has settled before the first moment."""
        lags = np.array([rig.exposure_lag, rig.white_balance_lag, rig.white_balance_lag])
        settings = [aims[0]]
        for i, span in enumerate(np.diff(times)):
            settings.append(_later(settings[-1], aims[i], aims[i + 1], span, span, lags))
        return AdaptationTrack(times, aims, lags, np.array(settings))

    def at(self, moment: float) -> Adaptation:
        """Return the settings at a time [s]; outside the metered times, those at the nearer end."""
        moment = float(np.clip(moment, self.times[0], self.times[-1]))
        i = int(np.searchsorted(self.times, moment, side="right")) - 1
        if i == len(self.times) - 1:
            return Adaptation(*self.settings[i].tolist())
        span, after = self.times[i + 1] - self.times[i], moment - self.times[i]
        start, end = self.aims[i], self.aims[i + 1]
        return Adaptation(*_later(self.settings[i], start, end, span, after, self.lags).tolist())


def _later(
    settings: np.ndarray,
    start: np.ndarray,
    end: np.ndarray,
    span: float,
    after: float,
    lags: np.ndarray,
) -> np.ndarray:
    """Return the settings ``after`` seconds, while the target goes from ``start`` to ``end`` in ``span``."""
    lags = np.maximum(lags, SHORTEST)
    slope = (end - start) / span
    behind = slope * lags  # how far a steady change stays ahead of the settings
    return start + slope * after - behind + (settings - start + behind) * np.exp(-after / lags)


def _limited(stops: float, limit: float) -> float:
    return min(max(stops, -limit), limit)
