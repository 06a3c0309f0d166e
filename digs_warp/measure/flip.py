"""FLIP: an image metric that models human vision and needs no network weights.

Optional: ``pip install 'digs-warp[metrics]'``.
"""

import numpy as np

from digs_warp.checks import DigsError, check_shape


def flip_map(image: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Return the FLIP error per pixel, 0 (same) to 1, shape (height, width), float32.

    Andersson et al., "FLIP: A Difference Evaluator for Alternating Images" (2020), the authors' code, for a
    viewer 0.7 m from a 0.7 m wide screen of 3840 px.

    Args:
        image: sRGB values in 0..1, shape (height, width, 3); values outside are clipped.
        target: the reference image, same shape.

    Raises:
        DigsError: the shapes do not match, or the extra is not installed.
    """
    try:
        import flip_evaluator
    except ImportError as error:
        raise DigsError("FLIP needs flip-evaluator: pip install 'digs-warp[metrics]'") from error
    first, second = _pair(image, target)
    errors, _, _ = flip_evaluator.evaluate(second, first, "LDR", applyMagma=False)
    return np.asarray(errors)[..., 0]


def flip(image: np.ndarray, target: np.ndarray, mask: np.ndarray | None = None) -> float:
    """Return the mean FLIP error, over ``mask`` (bool, (height, width)) if given; see `flip_map`.

    The error of a pixel also depends on its neighbors, inside or outside the mask. An empty mask gives NaN.
    """
    errors = flip_map(image, target)
    if mask is not None:
        errors = errors[mask]
    return float(errors.mean()) if errors.size else float("nan")


def _pair(image: np.ndarray, target: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    check_shape("image", image, (None, None, 3))
    check_shape("target", target, image.shape)
    first, second = (np.clip(np.asarray(x, np.float32), 0.0, 1.0) for x in (image, target))
    return np.ascontiguousarray(first), np.ascontiguousarray(second)
