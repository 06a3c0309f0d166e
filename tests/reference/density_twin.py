"""Float64 twins of density control, written from the papers one Gaussian at a time."""

import math
from fractions import Fraction

import numpy as np
from scipy.integrate import quad
from scipy.spatial.transform import Rotation


def rotation(quat: np.ndarray) -> np.ndarray:
    """Rotation matrix of one quaternion xyzw; zero means no rotation."""
    return Rotation.from_quat(quat).as_matrix() if np.any(quat) else np.eye(3)


def relocated(opacity: float, scale: float, copies: int) -> tuple[float, float]:
    """Opacity and scale of each of ``copies`` (3DGS-MCMC, equation 9), the double sum in exact arithmetic."""
    each = 1.0 - (1.0 - opacity) ** (1.0 / copies)
    exact = Fraction(each)
    total = 0.0
    for i in range(1, copies + 1):
        inner = sum(
            (-1) ** k * math.comb(i - 1, k) * exact ** (k + 1) * Fraction(1.0 / math.sqrt(k + 1))
            for k in range(i)
        )
        total += float(inner)
    return each, scale * opacity / total


def brightness_along_a_line(opacity: float, scale: float, copies: int) -> float:
    """Integral of the alpha that ``copies`` equal Gaussians give together, along a line through them."""

    def alpha(x: float) -> float:
        one = opacity * math.exp(-0.5 * (x / scale) ** 2)
        return 1.0 - (1.0 - one) ** copies

    return 2.0 * quad(alpha, 0.0, 12.0 * scale, epsabs=1e-12)[0]


def noise(
    quat: np.ndarray,
    log_scale: np.ndarray,
    logit: float,
    draw: np.ndarray,
    rate: float,
    extent: float,
) -> np.ndarray:
    """How far one center moves (3DGS-MCMC, equation 8), lengths in units of the extent."""
    axes = rotation(quat) * np.exp(log_scale)
    covariance = axes @ axes.T / extent**2
    opacity = 1.0 / (1.0 + math.exp(-logit))
    share = 1.0 / (1.0 + math.exp(100.0 * (opacity - 0.005)))
    return extent * 5e5 * rate * share * covariance @ draw
