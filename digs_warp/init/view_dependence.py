"""How much the color of a surface depends on where it is seen from, and the spherical harmonics it calls for.

Some of the first points are looked up in the photographs that see them. Their colors are fitted with every
degree, and each photograph is predicted from the others: noise, and points that lie a little off, look like
dependence on the view in a fit, but predict nothing. The prediction for a photograph that is left out of a
ridge regression follows from the fit with it (Allen's PRESS): residual / (1 - leverage).

Points that lie off by more, as the depth of a camera puts them, show another place of the surface to each
photograph. Where it has texture, that does predict: it changes smoothly with the direction, like gloss. So
points in plain surroundings are compared.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from digs_warp.data.viewpoints import evenly
from digs_warp.device.threads import over_rows
from digs_warp.geometry.sh import MAX_DEGREE, USUAL_DEGREE, coefficient_count, sh_basis

if TYPE_CHECKING:  # results name the decision, and need no kernels
    from digs_warp.init.seen_colors import SeenColors

# The most points that are compared.
POINTS = 2000
# Points that a core works on at once: what it computes from their colors fits into its cache.
CHUNK = 256
# A point is seen often enough for a prediction.
FEWEST_VIEWS = 8
# This share of the points seen often is compared: those with the least texture among their nearest neighbors.
PLAIN, NEIGHBORS = 0.25, 16
# Weight of the ridge, in photographs: what a higher band has to explain before it is believed.
RIDGE = 0.3
# By how much a higher degree has to predict better [dB]. Then all bands are trained: their slow learning
# damps what few photographs cannot tell better than the ridge does. Degree 3 instead of 1, 26 photographs,
# 400 steps, views of a perfect camera: a case of polished metal (predicted 2.1 dB) gains 1.6 dB, a flight
# helmet (1.1) 0.6, a tea set (0.5) 0.5, a bottle with a label (0.5) 0.2. Scenes of real cameras, 500 steps,
# exposure fitted: a cabinet (1.8) gains 1.0, a room (0.8) 0.3; simulated ones, 200 steps: a tea set and an
# armchair (0.2) 0.05 and -0.07.
WORTH_DB = 0.8


@dataclass(frozen=True)
class ViewDependence:
    """What the photographs show.

    Attributes:
        degree: of the spherical harmonics that they call for.
        errors: how well each degree from 0 on predicts a photograph from the others [dB, as PSNR of the
            points]; empty where too few points were seen often enough.
        points: how many were.
        because: the reason, in words.
    """

    degree: int
    errors: tuple[float, ...] = ()
    points: int = 0
    because: str = ""

    def __str__(self) -> str:
        return f"of degree {self.degree}: {self.because}"


def view_dependence(seen: "SeenColors") -> ViewDependence:
    """Choose the degree of the color by what the photographs show."""
    often = np.flatnonzero(np.isfinite(seen.colors[..., 0]).sum(axis=1) >= FEWEST_VIEWS)
    if not len(often):
        few = f"too few points are seen by {FEWEST_VIEWS} photographs or more"
        return ViewDependence(USUAL_DEGREE, because=few)
    points, colors = seen.points_world[often], seen.colors[often]
    plain = plainest(points, colors)
    some = plain[evenly(range(len(plain)), POINTS)]
    return chosen(points[some, None] - seen.centers_world, colors[some])


def plainest(points_world: np.ndarray, colors: np.ndarray) -> np.ndarray:
    """Return which points lie where the surface has the least texture, their numbers in order.

    Among them are a `PLAIN` share of the points, but at least `POINTS` if there are as many.

    Args:
        points_world: shape (n, 3), n at least 1.
        colors: of the points in the photographs, NaN where a point is not seen, shape (n, m, 3).
    """
    from scipy.spatial import KDTree

    count = len(points_world)
    wanted = max(POINTS, int(PLAIN * count))
    if count <= wanted:
        return np.arange(count)
    parts = over_rows(count, lambda rows: np.nanmean(colors[rows], axis=1), CHUNK)
    means = np.concatenate(parts)
    _, around = KDTree(points_world).query(points_world, k=NEIGHBORS, workers=-1)
    return np.sort(np.argsort(means[around].var(axis=1).sum(axis=1), kind="stable")[:wanted])


def chosen(directions: np.ndarray, colors: np.ndarray) -> ViewDependence:
    """Choose the degree by how well each predicts a color from the others.

    Args:
        directions: from each of m cameras to each of n points, any length, shape (n, m, 3).
        colors: what they see there, in 0..1, NaN where they do not, shape (n, m, 3).
    """
    basis = sh_basis(directions / np.linalg.norm(directions, axis=-1, keepdims=True), MAX_DEGREE)
    misses = [
        prediction_error(basis[..., : coefficient_count(d)], colors) for d in range(MAX_DEGREE + 1)
    ]
    errors = tuple(round(-10 * float(np.log10(max(miss, 1e-12))), 3) for miss in misses)
    gain = max(errors[USUAL_DEGREE + 1 :]) - errors[USUAL_DEGREE]
    because = (
        f"higher degrees predict a photograph from the others {gain:.1f} dB better than degree "
        f"{USUAL_DEGREE}, and are used from {WORTH_DB:g} dB on"
    )
    degree = MAX_DEGREE if gain >= WORTH_DB else USUAL_DEGREE
    return ViewDependence(degree, errors, len(colors), because)


def prediction_error(basis: np.ndarray, colors: np.ndarray) -> float:
    """Return the mean squared error of each color as the others of its point predict it.

    Args:
        basis: values of the k functions that are fitted, the constant first, shape (n, m, k).
        colors: shape (n, m, 3), NaN where a camera does not see the point.
    """
    parts = over_rows(len(colors), lambda rows: _left_out(basis[rows], colors[rows]), CHUNK)
    return float(np.mean(np.concatenate(parts) ** 2))


def _left_out(basis: np.ndarray, colors: np.ndarray) -> np.ndarray:
    """Return the errors of the colors that are seen, each predicted from the others of its point."""
    seen = np.isfinite(colors[..., :1])
    rows, values = np.where(seen, basis, 0.0), np.where(seen, colors, 0.0)
    ridge = RIDGE * np.eye(basis.shape[-1])
    ridge[0, 0] = 1e-9  # the mean color is free
    normal = np.einsum("nmk,nml->nkl", rows, rows) + ridge
    solved = np.linalg.solve(normal, np.swapaxes(rows, 1, 2))  # (n, k, m)
    residuals = values - rows @ (solved @ values)
    leverage = np.einsum("nmk,nkm->nm", rows, solved)
    left_out = residuals / np.maximum(1.0 - leverage[..., None], 1e-6)
    return left_out[np.broadcast_to(seen, colors.shape)]
