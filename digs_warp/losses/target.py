"""The target of a rendered view: the photograph over the background of the step.

A photograph is stored cropped to the box of its mask; outside the box, the target is only background. The
gain of a photograph (`digs_warp.measure.color_gain`) is taken off its colors; what the camera clipped then
tells only how bright the object is at least.

No term may judge pixels at which something else may hide the object: their target is the rendered image
itself. SSIM compares windows, which reach over from known pixels, so their gradient is erased.
"""

import numpy as np
import warp as wp

from digs_warp.checks import check_shape
from digs_warp.device.contiguous import bytes_from, fill, floats_from
from digs_warp.device.image_planes import ImagePlanes
from digs_warp.device.parallel import ParallelLaunch, put, values_per_thread
from digs_warp.geometry.rigid import PixelBox
from digs_warp.measure.color_gain import SATURATED, ColorGain

wp.set_module_options({"enable_backward": False, "max_unroll": 1})

# Only loops of fixed length are vectorized: a row is processed in pieces of this many pixels, then the rest.
_PIECE = wp.constant(32)
_SATURATED = wp.constant(SATURATED)


@wp.func
def unit(value: wp.uint8) -> float:
    """Return an 8-bit value scaled to 0..1."""
    return float(value) * (1.0 / 255.0)


@wp.func
def at_least(goal: float, shown: float, photo: wp.uint8, takes_gain: int) -> float:
    """Return the goal, or what is rendered where that is brighter than a photograph that was clipped."""
    clipped = int(photo) >= _SATURATED and takes_gain != 0
    return wp.where(clipped, wp.max(goal, shown), goal)


@wp.kernel
def compose_kernel(
    first_part: int,
    parts: int,  # of a row of the image, each of ``columns``, side by side
    columns: int,
    pitch: int,
    plane: int,
    origin: int,
    region: wp.array[int],  # [4] x0, y0, x1, y1: pixels to fill
    pixels: wp.array[wp.uint8],  # [4 * size] planes red, green, blue, mask of the box
    box: wp.array[int],  # [4] x0, y0, x1, y1: where the photograph lies
    background: wp.array[float],  # [3]
    factors: wp.array[float],  # [6] factor on each color of the photograph, then the shift
    takes_gain: int,  # 1: the photograph has a gain, and its clipped pixels are lower bounds
    rendered: wp.array[float],  # 3 padded planes of the same layout, read only with a gain
    # outputs
    target: wp.array[float],  # 3 padded planes
):
    """Fill one part of a row of the region."""
    part = first_part + wp.tid()
    y = part // parts
    left = wp.max(region[0], part % parts * columns)
    right = wp.min(region[2], (part % parts + 1) * columns)
    if y < region[1] or y >= region[3] or left >= right:
        return
    # Columns first .. last show the photograph; the region's columns on both sides show the background.
    first = right
    last = right
    if y >= box[1] and y < box[3]:
        first = wp.clamp(box[0], left, right)
        last = wp.clamp(box[2], first, right)
    start = origin + y * pitch
    width = last - first
    size = (box[2] - box[0]) * (box[3] - box[1])
    source = (y - box[1]) * (box[2] - box[0]) + first - box[0]
    whole = width // _PIECE
    for piece in range(whole + 1):
        at = start + first + piece * _PIECE
        taken = source + piece * _PIECE
        count = wp.min(_PIECE, width - piece * _PIECE)
        share = bytes_from(pixels, taken + 3 * size, count)
        for channel in range(3):
            back = background[channel]
            factor = factors[channel]
            shift = factors[3 + channel]
            shown = floats_from(rendered, at + channel * plane, count)
            goal = floats_from(target, at + channel * plane, count)
            photo = bytes_from(pixels, taken + channel * size, count)
            if count == _PIECE:
                for xc in range(_PIECE):
                    mixed_xc = back + unit(share[xc]) * (factor * unit(photo[xc]) + shift - back)
                    goal[xc] = at_least(mixed_xc, shown[xc], photo[xc], takes_gain)
            else:
                for tc in range(count):
                    mixed_tc = back + unit(share[tc]) * (factor * unit(photo[tc]) + shift - back)
                    goal[tc] = at_least(mixed_tc, shown[tc], photo[tc], takes_gain)
    for side in range(3):
        fill(target, start + side * plane + left, first - left, background[side])
        fill(target, start + side * plane + last, right - last, background[side])


# Positions of the arguments that change from view to view in the inputs of `compose_kernel`.
_PIXELS, _TAKES_GAIN, _RENDERED = 6, 10, 11
_UNCHANGED = np.array([1, 1, 1, 0, 0, 0], dtype=np.float32)


def pack_view(image: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Return the planes red, green, blue, mask of a view in one flat uint8 array."""
    height, width = mask.shape
    check_shape("image", image, (height, width, 3))
    planes = np.concatenate([image.transpose(2, 0, 1).reshape(3, -1), mask.reshape(1, -1)])
    return np.ascontiguousarray(planes, dtype=np.uint8).reshape(-1)


class Target:
    """The target of a step, on the device, for images up to the given size.

    Args:
        width, height: of the largest view [px].
        device: Warp device.

    Attributes:
        image: three padded planes, the composited photograph.
    """

    def __init__(self, width: int, height: int, device: str = "cpu") -> None:
        self.image = ImagePlanes(width, height, 3, device)
        self._background = wp.zeros(3, dtype=float, device=device)
        self._factors = wp.array(_UNCHANGED, dtype=float, device=device)
        self._has_gain = False
        self._region = wp.zeros(4, dtype=int, device=device)
        self._box = wp.zeros(4, dtype=int, device=device)
        columns = values_per_thread(device, width)
        parts = -(-width // columns)
        layout = [self.image.pitch, self.image.plane, self.image.origin, self._region]
        self._compose = ParallelLaunch(
            compose_kernel,
            height * parts,
            [parts, columns, *layout, wp.zeros(4, dtype=wp.uint8, device=device)]
            + [self._box, self._background, self._factors, 0, self.image.data, self.image.data],
            device,
            even=True,  # few launches: setting what changes takes longer than an idle moment of a core
        )

    def compose(
        self,
        pixels: wp.array,
        box: PixelBox,
        background: np.ndarray,
        region: PixelBox,
        size: tuple[int, int],
        gain: ColorGain | None = None,
        rendered: ImagePlanes | None = None,
    ) -> None:
        """Fill the target inside ``region``.

        Args:
            pixels: the view inside ``box``, packed by `pack_view`.
            box: where the photograph lies.
            background: sRGB color (3,) behind the object.
            region: pixels to fill, inside the view.
            size: width and height of the view [px].
            gain: what to take off the photograph's colors. Default: nothing.
            rendered: what the target is compared with, in the same layout; needed with a gain.
        """
        if size != (self.image.width, self.image.height):
            # SSIM windows read past the edge of a view, so no pixels of a larger view may remain there.
            self.image.resize(*size)
        put(self._background, background)
        put(self._region, region)
        put(self._box, box)
        self._compose.set_param(_PIXELS, pixels)
        self._take_off(gain, rendered)
        self._compose.run()

    def _take_off(self, gain: ColorGain | None, rendered: ImagePlanes | None) -> None:
        # Also without a gain: a loop that reads what it writes is not vectorized.
        if rendered is not None:
            self._compose.set_param(_RENDERED, rendered.data)
        if gain is not None and rendered is not None:
            put(self._factors, np.concatenate(gain.removal()))
        elif self._has_gain:
            put(self._factors, _UNCHANGED)
        self._has_gain = gain is not None
        self._compose.set_param(_TAKES_GAIN, int(self._has_gain))


def accept(places: np.ndarray, image: ImagePlanes, target: ImagePlanes) -> None:
    """Take what is rendered for the target at `places`; call it between target and terms."""
    _put(places, target, image.data.numpy()[places])


def erase(places: np.ndarray, adj_image: ImagePlanes) -> None:
    """Erase the gradient with respect to the image; call it after the terms."""
    _put(places, adj_image, 0.0)


def places_of(unknown: np.ndarray, planes: ImagePlanes) -> np.ndarray:
    """Return the indices of pixels, rows and columns (2, n), in three planes, (3, n)."""
    first = planes.origin + unknown[0] * planes.pitch + unknown[1]
    return first + planes.plane * np.arange(3)[:, None]


def _put(places: np.ndarray, planes: ImagePlanes, values: np.ndarray | float) -> None:
    data = planes.data.numpy()  # on a CPU no copy
    data[places] = values
    if str(planes.data.device) != "cpu":
        planes.data.assign(data)
