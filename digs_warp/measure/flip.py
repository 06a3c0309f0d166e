"""FLIP: an image metric that models human vision and needs no network weights.

Optional: ``pip install 'digs-warp[metrics]'``.
"""

import numpy as np

from digs_warp.checks import DigsError, check_shape


def flip(image: np.ndarray, target: np.ndarray, mask: np.ndarray | None = None) -> float:
    """Return the mean FLIP error, 0 (same) to 1.

    Andersson et al., "FLIP: A Difference Evaluator for Alternating Images" (2020), the authors' code, for a
    viewer 0.7 m from a 0.7 m wide screen of 3840 px. Neighbors count, inside or outside the mask.

    Args:
        image: sRGB values in 0..1, shape (height, width, 3); values outside are clipped.
        target: the reference image, same shape.
        mask: pixels to count, bool, (height, width). Default: all. An empty one gives NaN.

    Raises:
        DigsError: the shapes do not match, or the extra is not installed.
    """
    try:
        import flip_evaluator
    except ImportError as error:
        raise DigsError("FLIP needs flip-evaluator: pip install 'digs-warp[metrics]'") from error
    check_shape("image", image, (None, None, 3))
    check_shape("target", target, image.shape)
    wanted, shown = (
        np.ascontiguousarray(np.clip(np.asarray(each, np.float32), 0.0, 1.0))
        for each in (target, image)
    )
    errors = flip_evaluator.evaluate(wanted, shown, "LDR", applyMagma=False)[0]
    counted = np.asarray(errors)[..., 0][... if mask is None else mask]
    return float(counted.mean()) if counted.size else float("nan")
