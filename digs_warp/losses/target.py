"""What a rendered view is compared with: the photograph over the background of the step, and its mask.

A photograph is stored cropped to the box of its mask: outside, the target is the background alone.
"""

import numpy as np
import warp as wp

from digs_warp.checks import check_shape
from digs_warp.device.image_planes import ImagePlanes
from digs_warp.device.parallel import ParallelLaunch
from digs_warp.geometry import PixelBox
from digs_warp.losses.compose import compose_kernel

# Positions of the arguments that change from view to view in the inputs of `compose_kernel`.
_PIXELS, _KEEPS_COLOR = 4, 6


def pack_view(image: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Return the planes red, green, blue, mask of a view in one flat uint8 array."""
    height, width = mask.shape
    check_shape("image", image, (height, width, 3))
    planes = np.concatenate([image.transpose(2, 0, 1).reshape(3, -1), mask.reshape(1, -1)])
    return np.ascontiguousarray(planes, dtype=np.uint8).reshape(-1)


class Target:
    """The target of a step, on the device, for images of any size up to the given one.

    Attributes:
        image: three padded planes, the composited photograph.
        mask: one padded plane, the mask in 0..1.
    """

    def __init__(self, width: int, height: int, device: str = "cpu", threads: int = 0) -> None:
        self.image = ImagePlanes(width, height, 3, device)
        self.mask = ImagePlanes(width, height, 1, device)
        self._background = wp.zeros(3, dtype=float, device=device)
        self._region = wp.zeros(4, dtype=int, device=device)
        self._box = wp.zeros(4, dtype=int, device=device)
        layout = [self.image.pitch, self.image.plane, self.image.origin, self._region]
        self._compose = ParallelLaunch(
            compose_kernel,
            height,
            [*layout, wp.zeros(4, dtype=wp.uint8, device=device), self._box, 0, self._background]
            + [self.image.data, self.mask.data],
            device,
            threads,
        )

    def compose(
        self,
        pixels: wp.array,
        box: PixelBox,
        background: np.ndarray,
        region: PixelBox,
        size: tuple[int, int],
        keep_color: bool = False,
    ) -> None:
        """Fill the target inside ``region``.

        Args:
            pixels: the view inside ``box``, packed by `pack_view`.
            box: where the photograph lies; outside, the mask is 0.
            background: sRGB colour (3,) behind the object.
            region: pixels to fill, inside the view.
            size: width and height of the view [px].
            keep_color: take the photograph as it is, whatever its mask says.
        """
        if size != (self.image.width, self.image.height):
            # Windows read past the edge of a view: nothing of a larger one may be left there.
            self.image.resize(*size)
            self.mask.resize(*size)
        self._background.assign(np.asarray(background, dtype=np.float32))
        self._region.assign(np.array(region, dtype=np.int32))
        self._box.assign(np.array(box, dtype=np.int32))
        self._compose.set_param(_PIXELS, pixels)
        self._compose.set_param(_KEEPS_COLOR, int(keep_color))
        self._compose.run()
