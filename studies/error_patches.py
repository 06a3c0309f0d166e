"""Can a classifier tell the errors of two sensors apart? Statistics of small patches of the error."""

from collections.abc import Sequence

import numpy as np

PATCH = 32  # [px]
LAGS = (2, 4, 8, 16)  # [px]; autocorrelation along both axes
MIN_KNOWN = 0.5  # share of a patch that must have values
LIMIT = 8.0  # larger errors count as this [px]


def patch_features(error: np.ndarray) -> np.ndarray:
    """Return features of every patch that has enough values, shape (patches, 12); holes are ignored.

    Mean, logarithm of the standard deviation, skewness, kurtosis, and autocorrelation at four lags along x
    and y.

    Args:
        error: sensed minus true disparity [px], (height, width), NaN where there is none.
    """
    rows, columns = (size // PATCH for size in error.shape)
    blocks = error[: rows * PATCH, : columns * PATCH].reshape(rows, PATCH, columns, PATCH)
    patches = blocks.swapaxes(1, 2).reshape(-1, PATCH, PATCH).clip(-LIMIT, LIMIT)
    patches = patches[np.isfinite(patches).mean(axis=(1, 2)) >= MIN_KNOWN]
    mean, spread = (f(patches, axis=(1, 2)) for f in (np.nanmean, np.nanstd))
    unit = (patches - mean[:, None, None]) / (spread[:, None, None] + 1e-3)
    products = [unit**3, unit**4]
    products += [unit[:, :, :-lag] * unit[:, :, lag:] for lag in LAGS]
    products += [unit[:, :-lag] * unit[:, lag:] for lag in LAGS]
    means = [np.nanmean(product, axis=(1, 2)) for product in products]
    return np.nan_to_num(np.stack([mean, np.log(spread + 1e-3), *means], axis=1))


def auc_of_classifier(first: Sequence[np.ndarray], second: Sequence[np.ndarray]) -> float:
    """Return the area under the curve of a classifier between two sensors; 0.5: it cannot tell them.

    Each scene is judged by a random forest that learned from the others.

    Args:
        first: features of one sensor, an array for each scene; see `patch_features`.
        second: of the other, for the same scenes.
    """
    from sklearn.ensemble import RandomForestClassifier
    from sklearn.metrics import roc_auc_score
    from sklearn.model_selection import LeaveOneGroupOut, cross_val_predict

    scenes = [*first, *second]
    groups = np.repeat([*range(len(first))] * 2, [len(features) for features in scenes])
    labels = np.repeat([0, 1], [sum(map(len, first)), sum(map(len, second))])
    chances = cross_val_predict(
        RandomForestClassifier(100, min_samples_leaf=5, random_state=0),
        np.concatenate(scenes),
        labels,
        groups=groups,
        cv=LeaveOneGroupOut(),
        method="predict_proba",
    )
    return float(roc_auc_score(labels, np.asarray(chances)[:, 1]))
