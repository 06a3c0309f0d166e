"""Masks that people hand in, after public bug reports: numbers, alpha, other names, none at all."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from digs_warp.data.capture import Capture, read_capture
from digs_warp.data.images import encode_jpeg, mask_of, write_image
from digs_warp.data.layers import Layer
from digs_warp.formats.captures.formats import export_capture, read_recording
from reference.handed_in import nerfstudio, save
from reference.recorded import HEIGHT, WIDTH, converted


def blob(value: int, dtype: type = np.uint8) -> np.ndarray:
    mask = np.zeros((8, 10), dtype)
    mask[2:6, 3:8] = value
    return mask


def rgba(color: np.ndarray, alpha: np.ndarray) -> np.ndarray:
    return np.dstack([color, color, color, alpha])


NOISE = np.random.default_rng(0).integers(0, 256, (8, 10), dtype=np.uint8)
MASKS: dict[str, np.ndarray] = {
    "as usual": blob(255),
    "of one": blob(1),
    "number three": blob(3),
    "several numbers": np.where(np.arange(10) % 2, blob(3), blob(7)).astype(np.uint8),
    "a gray": blob(128),
    "alpha beside white": rgba(np.full((8, 10), 255, np.uint8), blob(255)),
    "alpha beside black": rgba(np.zeros((8, 10), np.uint8), blob(255)),
    "a cut-out": rgba(NOISE, blob(255)),
    "gray with alpha": np.dstack([np.full((8, 10), 255, np.uint8), blob(255)]),
    "numbers in alpha": rgba(np.zeros((8, 10), np.uint8), blob(2)),
    "opaque": rgba(blob(255), np.full((8, 10), 255, np.uint8)),
    "green": np.dstack([blob(0), blob(255), blob(0)]),
    "16 bits": blob(65535, np.uint16),
    "a number of 16 bits": blob(1000, np.uint16),
    "floats": blob(1, np.float32),
    "integers": blob(4, np.int64),
}


@pytest.mark.parametrize("name", MASKS)
def test_masks_are_read_by_what_they_hold(name: str) -> None:
    pixels = MASKS[name].reshape(8, 10, -1)
    np.testing.assert_array_equal(mask_of(pixels)[0], blob(255))


@pytest.mark.parametrize("direct", [False, True])
def test_numbers_and_alpha_are_masks_in_folders_too(
    capture: Capture, tmp_path: Path, caplog: pytest.LogCaptureFixture, direct: bool
) -> None:
    folder = tmp_path / "ns"
    nerfstudio(capture, folder)
    for number, frame in enumerate(capture.frames):
        on = frame.load_mask() > 127
        pixels = np.where(on, 3, 0).astype(np.uint8)
        if number == 1:
            pixels = rgba(np.full(on.shape, 255, np.uint8), np.where(on, 255, 0).astype(np.uint8))
        write_image(folder / f"masks/{number:04d}.png", pixels)
    found = read_capture(folder) if direct else converted("nerfstudio", folder, tmp_path / "c")
    for frame, true in zip(found.frames, capture.frames, strict=True):
        np.testing.assert_array_equal(frame.load_mask() > 127, true.load_mask() > 127)
    if not direct:
        assert caplog.text.count("masks hold numbers of objects") == 1


MASK_NAMES = {
    "stem": "{0}.png",
    "with suffix": "{0}.png.png",
    "word behind": "{0}_mask.png",
    "word before": "mask_{0}.png",
    "upper case": "{0}.PNG",
    "number": "object-{0}.png",
    "jpeg": "{0}.jpg",
    "folder": "{0}.png",
}


@pytest.mark.parametrize("form", ["colmap", "nerfstudio", "tum", "redwood"])
@pytest.mark.parametrize("name", MASK_NAMES)
def test_masks_beside_the_images_are_found(
    capture: Capture, tmp_path: Path, form: str, name: str
) -> None:
    folder = tmp_path / "recording"
    export_capture(capture, form, folder)
    shutil.rmtree(folder / "masks", ignore_errors=True)
    if form == "nerfstudio":
        index = json.loads((folder / "transforms.json").read_text())
        save(folder, index | {"frames": [f | {"mask_path": None} for f in index["frames"]]})
    for frame in read_recording(folder, form).frames:
        mask = capture.frames[0].load_mask()
        path = folder / ("Masks" if name == "folder" else "masks")
        path /= MASK_NAMES[name].format(frame.image.stem)
        path.parent.mkdir(exist_ok=True)
        if path.suffix == ".jpg":
            path.write_bytes(encode_jpeg(np.repeat(mask[..., None], 3, axis=2), 100))
        else:
            write_image(folder / "made.png", mask)
            (folder / "made.png").rename(path)
    for frame in converted(form, folder, tmp_path / "c").frames:
        found = frame.load_mask() > 127
        np.testing.assert_array_equal(found, capture.frames[0].load_mask() > 127)


def test_masks_that_fit_no_image_are_told(
    capture: Capture, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    folder = tmp_path / "colmap"
    export_capture(capture, "colmap", folder)
    for number, path in enumerate(sorted((folder / "masks").iterdir())):
        path.rename(folder / f"masks/{'abc'[number]}.png")
    converted("colmap", folder, tmp_path / "c")
    assert re.search(r"files in '.*masks' fit no image; name them like.*3 times", caplog.text)


def test_an_opaque_image_has_no_mask(capture: Capture, tmp_path: Path) -> None:
    folder, opaque = tmp_path / "ns", np.full((HEIGHT, WIDTH), 255, np.uint8)
    index = nerfstudio(capture, folder)
    for entry, frame in zip(index["frames"], capture.frames, strict=True):
        del entry["mask_path"]
        write_image(folder / entry["file_path"], np.dstack([frame.load_image(), opaque]))
    shutil.rmtree(folder / "masks")
    save(folder, index)
    found = converted("nerfstudio", folder, tmp_path / "c")
    assert not any(frame.has(Layer.MASK) for frame in found.frames)
