"""All image file access: OpenImageIO reads and writes PNG, EXR and HDR. Rows go top to bottom.

Written to a disk that is full, OpenImageIO reports success for a truncated PNG. So images are encoded in
memory, and written through `digs_warp.record.files`, which checks each write.
"""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.bounds import IMAGE, IMAGE_VALUES
from digs_warp.checks import CaptureError, DigsError, check_shape, require_file
from digs_warp.record.arrays import read_array
from digs_warp.record.files import write_atomically


def _encoded(form: str, spec: Any, pixels: np.ndarray) -> bytes:
    """Return a "png" or "exr" file of pixels, (height, width, channels), with an `OpenImageIO.ImageSpec`."""
    import OpenImageIO as oiio

    with _memory_file(form) as path:
        target = oiio.ImageOutput.create(form)
        if target is None or not target.open(str(path), spec):
            raise DigsError(f"cannot be written ({oiio.geterror()})")
        written = target.write_image(pixels)
        closed = target.close()
        problem = target.geterror()
        data = path.read_bytes()
    if not (written and closed) or problem:
        raise DigsError(f"cannot be written ({problem.strip()})")
    if len(data) >= _most_bytes():  # OpenImageIO says nothing of what did not fit
        raise DigsError(f"cannot be written: files are limited to {len(data)} bytes (ulimit -f)")
    return data


def _most_bytes() -> float:
    """Return the limit on the size of a file, where the system has one."""
    try:
        import resource
    except ImportError:
        return np.inf
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)[0]
    return np.inf if limit == resource.RLIM_INFINITY else limit


@contextmanager
def _memory_file(form: str) -> Iterator[Path]:
    """Give the name of an empty file in memory; where the system has none, of a temporary file."""
    if hasattr(os, "memfd_create"):
        descriptor = os.memfd_create(form)
        try:
            yield Path(f"/proc/self/fd/{descriptor}")
        finally:
            os.close(descriptor)
    else:
        with tempfile.TemporaryDirectory() as folder:
            yield Path(folder) / f"image.{form}"


# Used where a format requires a date.
NO_DATE = "1970:01:01 00:00:00"

# PNG row filters by libpng's numbers: a byte minus its left neighbor, or minus the mean of its left and upper
# neighbors.
PNG_FILTER_SUB, PNG_FILTER_AVG = 0x10, 0x40


def read_image(path: Path, what: str = "image") -> np.ndarray:
    """Return the pixels of a file, shape (height, width, channels), in the file's own number type.

    Integers stay as they are, floating-point files give float32. Nothing is converted between color spaces.
    Arrays of NumPy (``.npy``, ``.npz``) are read, too.

    Raises:
        DigsError: the file is missing, truncated, no image, or larger than `digs_warp.bounds.IMAGE`.
    """
    import OpenImageIO as oiio

    if path.suffix.lower() in ARRAYS:
        return _of_array(read_array(path, what), f"{what} '{path}'")
    with _opened(path, what) as source:
        spec = source.spec()
        kind = spec.format.basetype
        kind = oiio.FLOAT if kind in (oiio.HALF, oiio.DOUBLE) else kind
        pixels = source.read_image(kind)
        problem = _error_of(source)
    if pixels is None or problem:
        raise DigsError(
            f"{what} '{path}': expected {spec.width}x{spec.height} pixels, but the data breaks off "
            f"({problem.strip() or 'no pixels'}). Copy or export the file again."
        )
    pixels = np.asarray(pixels).reshape(spec.height, spec.width, spec.nchannels)
    return pixels if (order := _order(spec, what)) is None else pixels[..., order]


ARRAYS = (".npy", ".npz")


def _order(spec: Any, what: str) -> list[int] | None:
    """Return which channels to take: only depth where colors are beside it, else alpha last; None: all."""
    names = [name.rpartition(".")[2].lower() for name in spec.channelnames]
    own = [i for i, name in enumerate(names) if name in ("z", "v", "depth")]
    if what == "depth" and own and len(names) > 1:
        return own[:1]
    if (alpha := spec.alpha_channel) in (-1, len(names) - 1):
        return None
    return [*(i for i in range(len(names)) if i != alpha), alpha]


def image_size(path: Path, what: str = "image") -> tuple[int, int]:
    """Return (width, height) of a file, from its header if it is an image; errors as of `read_image`."""
    if path.suffix.lower() in ARRAYS:
        height, width = read_image(path, what).shape[:2]
        return width, height
    with _opened(path, what) as source:
        return source.spec().width, source.spec().height


def _of_array(array: np.ndarray, where: str) -> np.ndarray:
    """Return an array as the pixels of an image; one that comes first is the only channel."""
    if array.ndim == 3 and array.shape[0] == 1:
        array = array[0]
    if array.ndim not in (2, 3) or array.size == 0 or array.dtype.kind not in "buif":
        raise DigsError(
            f"{where}: {array.dtype} of shape {array.shape}, expected numbers, (height, width)"
        )
    IMAGE.check(where, array.shape[0] * array.shape[1])
    pixels = array.reshape(*array.shape[:2], -1)
    if array.dtype.kind == "b":
        return pixels.astype(np.uint8)
    return pixels.astype(np.float32) if array.dtype.kind == "f" else pixels


# Integers that mean "unknown", beside 0, negative ones and the largest of their kind; in metres, what becomes
# of the first, and what half floats and Blender write for it.
UNKNOWN_DEPTH, UNKNOWN_METRES, ENDLESS = 65535, np.float32(65.535), np.float32(65504.0)

MM_PER_METRE = 1000.0

PICTURE_CURE = (
    "export the raw depth (librealsense: the Z16 frame, without the colorizer), or leave depth out"
)


def depth_in_metres(
    pixels: np.ndarray,
    where: str,
    units_per_metre: float = MM_PER_METRE,
    float_units_per_metre: float = 1.0,
) -> np.ndarray:
    """Return planar depth [m], (height, width), float32, NaN where unknown: of all files that hold depth.

    The type of the numbers decides on the unit, never the kind of file.

    Args:
        pixels: as `read_image` returns them.
        where: names the file in messages.
        units_per_metre: of integers.
        float_units_per_metre: of floats.

    Raises:
        CaptureError: a picture of depth, in colors or in 256 steps of gray.
    """
    colored = pixels.shape[2] >= 3 and not np.array_equal(
        pixels[..., :2], pixels[..., 1:3], equal_nan=pixels.dtype.kind == "f"
    )
    if colored or pixels.dtype.itemsize == 1:
        found = "colors" if colored else "8 bits per pixel"
        raise CaptureError(
            f"{where}: {found}, a picture of depth, expected its values: 16-bit integers in millimetres or "
            f"floats in metres, one channel; {PICTURE_CURE}"
        )
    depth = pixels[..., 0].astype(np.float32)
    if pixels.dtype.kind == "f":
        depth /= np.float32(float_units_per_metre)
        unknown = ~((depth > 0) & (depth < ENDLESS)) | (depth == UNKNOWN_METRES)
    else:
        unknown = (pixels[..., 0] <= 0) | (pixels[..., 0] == UNKNOWN_DEPTH)
        unknown |= pixels[..., 0] == np.iinfo(pixels.dtype).max
        depth /= np.float32(units_per_metre)
    depth[unknown] = np.nan
    return depth


# More different values are shades, not the numbers of objects.
MOST_NUMBERS = 32

# What masks mark is made brighter below the first. Below the other, JPEG may have spoilt numbers of objects.
DIM, DARK = 170, 64

IN_ALPHA = "masks are in the alpha channel of their files"
NUMBERED = "masks hold numbers of objects, or 1: all but 0 counts as object"
BRIGHTENED = "masks are darker than 255, and are made brighter"


def mask_of(pixels: np.ndarray, path: object = "") -> tuple[np.ndarray, str | None]:
    """Return the mask that a file holds in any of the usual ways, 0 to 255, (height, width), uint8.

    Shades from 0 to 255 stay. Of a cut-out, the alpha channel is the mask, unless its colors are one; where
    most of what is not 0 is not 255 either, values are few, and they are numbers of objects.

    Args:
        pixels: as `read_image` returns them.
        path: of their file, if they have one.

    Returns:
        The mask, and what was found out about it, a clause; None: it is as usual.

    Raises:
        CaptureError: what may be numbers of objects, in a JPEG file.
    """
    is_jpeg = str(path).lower().endswith(("jpg", "jpeg"))
    shown = pixels[..., :3].max(axis=2) if pixels.shape[2] >= 3 else pixels[..., 0]
    values, note = _eight_bits(shown), None
    if pixels.shape[2] in (2, 4):
        alpha = _eight_bits(pixels[..., -1])
        is_mask = np.count_nonzero(np.bincount(values.reshape(-1), minlength=256)) == 2
        if alpha.min() < alpha.max() and not is_mask:
            values, note = alpha, IN_ALPHA
    counts = np.bincount(values.reshape(-1), minlength=256)
    numbers, bright = counts[1:].sum(), counts[250:].sum()
    upper = np.where(np.arange(256) > values.max() // 2, counts, 0).cumsum()
    level = int(np.searchsorted(upper, upper[-1] / 2)) if numbers else 255  # of what is marked
    if is_jpeg and level < DARK:
        raise CaptureError(
            f"mask '{path}': what it marks has the value {level}, and JPEG does not keep numbers of objects; "
            "write masks as PNG, or mark with 255"
        )
    if not is_jpeg and np.count_nonzero(counts[1:]) <= MOST_NUMBERS and 2 * bright < numbers:
        values, note = np.where(values > 0, np.uint8(255), np.uint8(0)), note or NUMBERED
    elif level < DIM:
        values = np.minimum(values * np.float32(255 / level), 255).astype(np.uint8)
        note = note or BRIGHTENED
    return np.ascontiguousarray(values), note


def _eight_bits(values: np.ndarray) -> np.ndarray:
    """Return shades as 0 to 255, and numbers of objects as themselves; those above 255 as 1."""
    largest = values.max()
    if values.dtype == np.uint8:
        return values
    if values.dtype.kind == "f":
        values = np.nan_to_num(values)
        shades = 255 * values if largest <= 1 else values
        return np.clip(np.ceil(shades), 0, 255).astype(np.uint8)
    if largest <= 255:
        return np.maximum(values, 0).astype(np.uint8)
    if values.dtype == np.uint16 and (largest == 65535 or len(np.unique(values)) > MOST_NUMBERS):
        return (values // 257).astype(np.uint8)
    return (values > 0).astype(np.uint8)


@contextmanager
def _opened(path: Path, what: str) -> Iterator[Any]:
    """Open an image for the block, as an `OpenImageIO.ImageInput`, if its header promises a bounded size."""
    import OpenImageIO as oiio

    require_file(path, what)
    # Without this, the colors of transparent pixels are premultiplied by alpha.
    config = oiio.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)
    try:
        source = oiio.ImageInput.open(str(path), config)
    except TypeError:  # what it says of a name with half a character
        raise DigsError(
            f"{what} '{path}': its name, or that of a folder, is no UTF-8; rename it"
        ) from None
    if source is None:
        raise DigsError(f"{what} '{path}': cannot be opened as an image ({_error_of(oiio)})")
    try:
        spec = source.spec()
        IMAGE.check(f"{what} '{path}'", spec.width * spec.height)
        IMAGE_VALUES.check(f"{what} '{path}'", spec.width * spec.height * spec.nchannels)
        yield source
    finally:
        source.close()


def _error_of(source: Any) -> str:
    """Return what OpenImageIO, or one of its inputs, says about its last failure."""
    try:
        return source.geterror()
    except UnicodeDecodeError:  # it quotes the broken bytes
        return "names in its header are not UTF-8"


def write_image(path: Path, pixels: np.ndarray) -> None:
    """Write uint8, uint16 or float32 pixels, shape (height, width) or (height, width, channels).

    The suffix decides the format: PNG for integers (8 bits are sRGB color or a mask, 16 bits are data
    such as depth), EXR (lossless ZIP, NaN kept) for float32. The file appears under its name only when
    it is complete.
    """
    path = Path(path)
    try:
        data = encode_image(pixels, path.suffix)
    except DigsError as error:
        raise DigsError(f"image '{path}': {error}") from None
    write_atomically(path, data)


def encode_image(pixels: np.ndarray, suffix: str) -> bytes:
    """Return the file that `write_image` writes under a name with the suffix ".png" or ".exr"."""
    import OpenImageIO as oiio

    kinds = {"uint8": oiio.UINT8, "uint16": oiio.UINT16, "float32": oiio.FLOAT}
    if str(pixels.dtype) not in kinds or (suffix == ".png") != (pixels.dtype.kind == "u"):
        raise ValueError(f"cannot write {pixels.dtype} pixels as {suffix}")
    image = np.ascontiguousarray(pixels.reshape(*pixels.shape[:2], -1))
    height, width, channels = image.shape
    spec = oiio.ImageSpec(width, height, channels, kinds[str(pixels.dtype)])
    spec.attribute("oiio:UnassociatedAlpha", 1)  # colors are stored as they are
    if suffix == ".exr":
        # Level 1 takes two thirds of the time of the default 4; files are 5 % larger.
        spec.attribute("compression", "zip:1")
    if pixels.dtype == np.uint16:
        # 16 bits hold depth, not color. Marked as sRGB, libpng's readers (Open3D) would undo its gamma.
        spec.attribute("oiio:ColorSpace", "data")
    # Otherwise OpenImageIO puts the time into EXR files: same pixels, different bytes.
    spec.attribute("DateTime", NO_DATE)
    if suffix == ".png":
        _choose_png_coding(spec, image)
    return _encoded(suffix[1:], spec, image)


def _choose_png_coding(spec: Any, image: np.ndarray) -> None:
    """Set in an `OpenImageIO.ImageSpec` how a PNG file is filtered and deflated, without loss.

    Photographs and masks have few repetitions: after a good filter, deflate's search for matches finds almost
    nothing. Without the search, a noisy photograph takes a quarter of the time, and less space.
    """
    if image.dtype == np.uint8:
        spec.attribute("png:filter", PNG_FILTER_AVG if image.shape[2] >= 3 else PNG_FILTER_SUB)
        spec.attribute("compression", "rle")
        spec.attribute("png:compressionLevel", 1)
    else:
        # A third of the time of the default 6, files 5 % larger.
        spec.attribute("png:compressionLevel", 3)


def encode_jpeg(pixels: np.ndarray, quality: int = 88) -> bytes:
    """Return a JPEG file of sRGB pixels, shape (height, width, 3), uint8, without chroma subsampling.

    Pillow writes it: OpenImageIO cannot write to memory, and where it cannot write, it ends the process.
    """
    from PIL import Image

    check_shape("JPEG pixels", pixels, (None, None, 3))
    data = BytesIO()
    Image.fromarray(pixels).save(data, "JPEG", quality=quality, subsampling=0)
    return data.getvalue()


def to_uint8(values: np.ndarray) -> np.ndarray:
    """Return 0..255 of values in 0..1, rounded and clipped; NaN gives 0."""
    return (np.clip(np.nan_to_num(values), 0.0, 1.0) * 255.0 + 0.5).astype(np.uint8)


def srgb_from_linear(linear: np.ndarray) -> np.ndarray:
    """Encode linear Rec.709 values (0..1) as sRGB (IEC 61966-2-1)."""
    linear = np.maximum(linear, 0.0)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def linear_from_srgb(srgb: np.ndarray) -> np.ndarray:
    """Decode sRGB values (0..1) to linear Rec.709."""
    srgb = np.maximum(srgb, 0.0)
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
