"""How sharp the images of a film are, and which of them repeat the one before."""

import numpy as np

# Frames are compared at this width [px]: noise averages out, blur from motion stays.
WIDTH = 480

# Sharpness of a frame that repeats the one before: films of another rate were filled up with such frames.
REPEATED = -1.0

# Mean difference of two frames [of 255] that are the same but for the codec's rounding.
SAME = 0.3


class Sharpness:
    """Measures the frames of a film one after the other."""

    def __init__(self) -> None:
        self._before: np.ndarray | None = None

    def __call__(self, image: np.ndarray) -> float:
        """Return the strength of the finest structure of an image, (height, width, ...), uint8.

        `REPEATED` if it is the same as the one before.
        """
        import cv2

        gray = image if image.ndim == 2 else image[..., 1]
        height = max(1, round(gray.shape[0] * WIDTH / gray.shape[1]))
        small = gray
        if gray.shape[1] > WIDTH:
            small = cv2.resize(gray, (WIDTH, height), interpolation=cv2.INTER_AREA)
        small = small.astype(np.float32)
        before, self._before = self._before, small
        if (
            before is not None
            and before.shape == small.shape
            and np.abs(small - before).mean() < SAME
        ):
            return REPEATED
        return float(cv2.Laplacian(small, cv2.CV_32F).var())
