"""Depth and masks that people hand in, after public bug reports: numbers, units, other names, none."""

import json
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest
from PIL import Image

from digs_warp.checks import CaptureError, DigsError
from digs_warp.data.capture import Capture, read_capture
from digs_warp.data.images import depth_in_metres, encode_jpeg, mask_of, read_image, write_image
from digs_warp.data.layers import Layer
from digs_warp.formats.captures.formats import export_capture, read_recording
from digs_warp.record.arrays import write_arrays
from reference.handed_in import FORMS, handed_in, nerfstudio, read, save
from reference.recorded import HEIGHT, WIDTH, check_same, converted

DEPTH = np.array([[0, 1000, 65535], [2500, 40, 0]], np.uint16)
METRES = np.array([[np.nan, 1.0, np.nan], [2.5, 0.04, np.nan]], np.float32)
DEPTHS: dict[str, tuple[np.ndarray, dict[str, float]]] = {
    "png": (DEPTH, {}),
    "integers": (np.where(DEPTH == 65535, -1, DEPTH).astype(np.int32), {}),
    "wide integers": (np.where(DEPTH == 65535, 2**32 - 1, DEPTH).astype(np.uint32), {}),
    "other unit": ((np.minimum(DEPTH, 13107) * 5).astype(np.uint16), {"units_per_metre": 5000.0}),
    "metres": (METRES, {}),
    "endless": (np.where(np.isnan(METRES), np.float32(1e10), METRES), {}),
    "half floats": (np.where(np.isnan(METRES), np.inf, METRES).astype(np.float16), {}),
    "largest of half floats": (np.where(np.isnan(METRES), np.float32(65504), METRES), {}),
    "integers divided": (DEPTH.astype(np.float32) / np.float32(1000), {}),
    "millimetres": (DEPTH.astype(np.float32), {"float_units_per_metre": 1000.0}),
}


@pytest.mark.parametrize("name", DEPTHS)
def test_the_kind_of_number_gives_the_unit_of_depth(tmp_path: Path, name: str) -> None:
    pixels, units = DEPTHS[name]
    path = tmp_path / "depth.npy"
    np.save(path, pixels)
    found = depth_in_metres(read_image(path, "depth"), "depth", **units)
    np.testing.assert_allclose(found, METRES, rtol=1e-3)


PICTURES = {
    "8 bits": np.tile(np.arange(WIDTH, dtype=np.uint8), (HEIGHT, 1)),
    "colors": np.random.default_rng(1).integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8),
    "colors of 16 bits": np.random.default_rng(1).integers(1, 9999, (HEIGHT, WIDTH, 3)).astype(np.uint16),
    "colors and alpha": np.random.default_rng(1).integers(0, 256, (HEIGHT, WIDTH, 4), dtype=np.uint8),
}  # fmt: skip


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", PICTURES)
def test_pictures_of_depth_are_refused(
    capture: Capture, tmp_path: Path, form: str, name: str
) -> None:
    _, folder = handed_in(capture, form, tmp_path)
    write_image(min(folder.rglob("depth/*.png")), PICTURES[name])
    with pytest.raises(CaptureError, match="a picture of depth, expected its values: 16-bit"):
        read(form, folder, tmp_path / "c").frames[0].load_depth()


@pytest.mark.parametrize("form", FORMS)
def test_the_largest_number_is_unknown_depth(capture: Capture, tmp_path: Path, form: str) -> None:
    _, folder = handed_in(capture, form, tmp_path)
    for depth in folder.rglob("depth/*.png"):
        pixels = read_image(depth)
        write_image(depth, np.where(pixels == 0, np.uint16(65535), pixels))
    check_same(read(form, folder, tmp_path / "c"), capture, 4e-3)


@pytest.mark.parametrize(
    ("dtype", "factor", "given"),
    [(np.int32, 1000, None), (np.float64, 1, None), (np.float32, 1000, 0.001), (np.uint16, 5000, 2e-4)],
)  # fmt: skip
def test_arrays_of_depth_are_read(
    capture: Capture, tmp_path: Path, dtype: type, factor: float, given: float | None
) -> None:
    folder = tmp_path / "ns"
    index = nerfstudio(capture, folder)
    for number, (entry, frame) in enumerate(zip(index["frames"], capture.frames, strict=True)):
        values = np.nan_to_num(frame.load_depth()) * factor
        np.save(folder / f"{number}.npy", np.minimum(values.round(), 65535).astype(dtype)
                if np.dtype(dtype).kind in "ui" else values.astype(dtype))  # fmt: skip
        entry["depth_file_path"] = f"{number}.npy"
    save(folder, index | ({} if given is None else {"depth_unit_scale_factor": given}))
    check_same(converted("nerfstudio", folder, tmp_path / "c"), capture, 4e-3)
    if given is None:
        check_same(read_capture(folder), capture, 4e-3)


def test_depth_of_nerfcapture_is_read_and_unread_files_are_told(
    capture: Capture, tmp_path: Path, caplog
) -> None:
    folder, scale = tmp_path / "ns", 8.0 / 65535
    index = nerfstudio(capture, folder, integer_depth_scale=scale)
    for number, (entry, frame) in enumerate(zip(index["frames"], capture.frames, strict=True)):
        units = np.round(np.nan_to_num(frame.load_depth()) / scale).astype(np.uint16)
        write_image(folder / f"images/{number}.depth.png", units)
        del entry["depth_file_path"]
        entry["depth_path"] = f"images/{number}.depth.png"
        entry["normal_file_path"] = entry["semantics"] = f"other/{number}.png"
    save(folder, index | {"imu_path": "imu.csv"})
    check_same(converted("nerfstudio", folder, tmp_path / "c"), capture, 4e-3)
    assert "files under 'imu_path' are not read" in caplog.text
    assert "files under 'normal_file_path' are not read (3 times)" in caplog.text
    assert "files under 'semantics' are not read (3 times)" in caplog.text
    assert "depth_path" not in caplog.text
    caplog.clear()
    read_capture(folder)
    assert "'depth_path' are not read (3 frames)" in caplog.text


@pytest.mark.parametrize("suffix", [".npy", ".exr", ".tiff"])
def test_folders_in_another_case_and_depth_in_other_files_are_read(
    capture: Capture, tmp_path: Path, suffix: str
) -> None:
    folder = tmp_path / "redwood"
    export_capture(capture, "redwood", folder)
    for number, frame in enumerate(capture.frames):
        path, depth = folder / f"depth/{number:05d}{suffix}", frame.load_depth()
        if suffix == ".npy":
            np.save(path, np.nan_to_num(1000 * depth).round().astype(np.int32))
        elif suffix == ".exr":  # beside a picture of it
            write_image(path, depth)
            write_image(path.with_suffix(".png"), PICTURES["8 bits"])
            continue
        else:
            Image.fromarray(np.nan_to_num(1000 * depth).round().astype(np.int32)).save(path)
        path.with_suffix(".png").unlink()
    (folder / "color").rename(folder / "Color")
    check_same(converted("redwood", folder, tmp_path / "c"), capture, 4e-3)


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
    "dim shades": np.where(np.arange(800).reshape(20, 40) < 60, np.arange(40), 127).astype(
        np.uint8
    ),
}


@pytest.mark.parametrize("name", MASKS)
def test_masks_are_read_by_what_they_hold(name: str) -> None:
    if name == "dim shades":
        pixels = MASKS[name][..., None]
        np.testing.assert_array_equal(mask_of(pixels)[0] > 127, pixels[..., 0] > 63)
        return
    pixels = MASKS[name].reshape(8, 10, -1)
    np.testing.assert_array_equal(mask_of(pixels)[0], blob(255))


@pytest.mark.parametrize("direct", [False, True])
def test_numbers_and_alpha_are_masks_in_folders_too(
    capture: Capture, tmp_path: Path, caplog, direct: bool
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
        mask = np.where(capture.frames[0].load_mask() > 127, 255, 0).astype(np.uint8)
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


def test_masks_that_fit_no_image_are_told(capture: Capture, tmp_path: Path, caplog) -> None:
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


@pytest.mark.parametrize("direct", [False, True])
def test_jpeg_keeps_shades_of_masks_and_no_numbers(
    capture: Capture, tmp_path: Path, direct: bool
) -> None:
    folder = tmp_path / "ns"
    index = nerfstudio(capture, folder)
    on = np.zeros((HEIGHT, WIDTH), bool)
    on[3:9, 4:15] = True

    def load(out: Path) -> Capture:
        return read_capture(folder) if direct else converted("nerfstudio", folder, out)

    for value in (128, 1, 20):
        for number, entry in enumerate(index["frames"]):
            entry["mask_path"] = f"masks/{number}.jpg"
            pixels = np.where(on, value, 0).astype(np.uint8)
            Image.fromarray(pixels).save(folder / entry["mask_path"], quality=75)
        save(folder, index)
        if value == 128:
            np.testing.assert_array_equal(load(tmp_path / "c").frames[0].load_mask() > 127, on)
        else:
            with pytest.raises(CaptureError, match="JPEG does not keep numbers of objects; write"):
                load(tmp_path / str(value)).frames[0].load_mask()


def write_channels(path: Path, **channels: np.ndarray) -> None:
    """An EXR of channels by their names, which has "__" for the dot of a layer."""
    spec = oiio.ImageSpec(WIDTH, HEIGHT, len(channels), oiio.FLOAT)
    spec.channelnames = [name.replace("__", ".") for name in channels]
    target: Any = oiio.ImageOutput.create(str(path))
    target.open(str(path), spec)
    target.write_image(np.stack([*channels.values()], axis=-1).astype(np.float32))
    target.close()


@pytest.mark.parametrize("names", ["A Z", "R G B A Z", "V.R V.G V.B V.A V.Depth.Z", "npz", "two"])
def test_the_channel_of_depth_is_found_beside_others(
    capture: Capture, tmp_path: Path, names: str
) -> None:
    folder = tmp_path / "ns"
    index = nerfstudio(capture, folder)
    for number, (entry, frame) in enumerate(zip(index["frames"], capture.frames, strict=True)):
        depth, path = frame.load_depth(), folder / f"{number}.exr"
        if names in ("npz", "two"):
            path = path.with_suffix(".npz")
            write_arrays(path, {"depth": depth} | ({"confidence": depth} if names == "two" else {}))
        else:
            layers = {each.replace(".", "__"): np.full(depth.shape, 0.1 * i) for i, each in
                      enumerate(names.split())}  # fmt: skip
            write_channels(path, **layers | {[*layers][-1]: depth})
        entry["depth_file_path"] = path.name
    save(folder, index)
    check_same(converted("nerfstudio", folder, tmp_path / "c"), capture, 1e-6)
    check_same(read_capture(folder), capture, 1e-6)
    if names == "two":
        for number in range(3):
            np.savez(folder / f"{number}.npz", a=np.ones(3), b=np.ones(3))
        with pytest.raises(DigsError, match=r"0\.npz': it has a, b, and none is called depth"):
            read_capture(folder).frames[0].load_depth()
