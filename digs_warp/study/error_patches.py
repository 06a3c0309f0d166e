"""Can a classifier tell the errors of two sensors apart? Statistics of small patches of the error."""

from collections.abc import Sequence

import numpy as np

PATCH = 32  # [px]
LAGS = (2, 4, 8, 16)  # [px]; autocorrelation along both axes
MIN_KNOWN = 0.5  # share of a patch that must have values
LIMIT = 8.0  # larger errors count as this [px]


def patch_features(error: np.ndarray) -> np.ndarray:
    """Return features of every patch that has enough values, shape (patches, 12).

    Mean, logarithm of the standard deviation, skewness, kurtosis, and autocorrelation at four lags along x
    and y. Holes are ignored.

    Args:
        error: sensed minus true disparity [px], (height, width), NaN where there is none.
    """
    rows, columns = (size // PATCH for size in error.shape)
    patches = [
        np.clip(error[y * PATCH : (y + 1) * PATCH, x * PATCH : (x + 1) * PATCH], -LIMIT, LIMIT)
        for y in range(rows)
        for x in range(columns)
    ]
    features = [_features(p) for p in patches if np.isfinite(p).mean() >= MIN_KNOWN]
    return np.array(features).reshape(-1, 4 + 2 * len(LAGS))


def _features(patch: np.ndarray) -> list[float]:
    mean, spread = np.nanmean(patch), np.nanstd(patch) + 1e-3
    unit = (patch - mean) / spread
    moments = [mean, np.log(spread), np.nanmean(unit**3), np.nanmean(unit**4)]
    pairs = [
        *((unit[:, :-lag], unit[:, lag:]) for lag in LAGS),
        *((unit[:-lag], unit[lag:]) for lag in LAGS),
    ]
    return [*map(float, moments), *(_mean_product(a, b) for a, b in pairs)]


def _mean_product(a: np.ndarray, b: np.ndarray) -> float:
    product = a * b
    known = np.isfinite(product)
    return float(product[known].mean()) if known.any() else 0.0


def auc_of_classifier(first: Sequence[np.ndarray], second: Sequence[np.ndarray]) -> float:
    """Return the area under the curve of a classifier between two sensors; 0.5: it cannot tell them.

    Each scene is judged by a random forest that learned from the others.

    Args:
        first: features of one sensor, an array for each scene; see `patch_features`.
        second: of the other, for the same scenes.
    """
    from sklearn.ensemble import RandomForestClassifier
    from sklearn.metrics import roc_auc_score

    scores, labels = [], []
    for left_out in range(len(first)):
        train = [
            (features, label)
            for label, sensor in enumerate((first, second))
            for scene, features in enumerate(sensor)
            if scene != left_out
        ]
        x = np.concatenate([features for features, _ in train])
        y = np.concatenate([np.full(len(features), label) for features, label in train])
        forest = RandomForestClassifier(100, min_samples_leaf=5, random_state=0).fit(x, y)
        for label, sensor in enumerate((first, second)):
            if len(sensor[left_out]):
                scores.append(forest.predict_proba(sensor[left_out])[:, 1])
                labels.append(np.full(len(sensor[left_out]), label))
    return float(roc_auc_score(np.concatenate(labels), np.concatenate(scores)))
