"""Gaussians, points, cameras and masks of a reconstruction: exact files, errors that name them."""

import io
import json
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.gaussians import (
    ANTIALIASED,
    CLASSIC,
    FIELDS,
    NO_FILTER,
    Gaussians,
    ScreenFilter,
    joined,
)
from digs_warp.data.layers import Layer
from digs_warp.data.objects import mask_of_text, text_of_mask
from digs_warp.data.point_cloud import read_points
from digs_warp.data.posed_frames import CAMERAS, PosedFrames
from digs_warp.splat.device import DeviceGaussians
from reference.tiny_capture import write_tiny_capture


def random_gaussians(count: int, sh_degree: int = 1) -> Gaussians:
    rng = np.random.default_rng(count)
    return Gaussians(
        means=rng.normal(size=(count, 3)),
        log_scales=rng.normal(size=(count, 3)),
        quats=rng.normal(size=(count, 4)),
        opacity_logits=rng.normal(size=count),
        sh=rng.normal(size=(count, (sh_degree + 1) ** 2, 3)),
    )


def test_what_is_saved_is_loaded(tmp_path: Path) -> None:
    for count, sh_degree in ((0, 3), (1, 0), (100, 1), (100, 2), (100, 3)):
        gaussians = random_gaussians(count, sh_degree)
        gaussians.save(tmp_path / "g.npz")
        loaded = Gaussians.load(tmp_path / "g.npz")
        assert loaded.sh_degree == sh_degree
        for name in FIELDS:
            assert getattr(loaded, name).dtype == np.float32
            np.testing.assert_array_equal(getattr(loaded, name), getattr(gaussians, name))
    assert [path.name for path in tmp_path.iterdir()] == ["g.npz"]


def test_files_that_are_missing_broken_or_of_others_are_named(tmp_path: Path) -> None:
    path = tmp_path / "g.npz"
    gaussians = random_gaussians(1000)
    arrays = {name: getattr(gaussians, name) for name in FIELDS}
    gaussians.save(path)
    data = path.read_bytes()
    half = len(data) // 2
    header = io.BytesIO()
    promise = {"descr": "<f4", "fortran_order": False, "shape": (10**13, 3)}
    np.lib.format.write_array_header_1_0(header, promise)
    with zipfile.ZipFile(tmp_path / "promise.npz", "w") as archive:
        for name in FIELDS:
            archive.writestr(f"{name}.npy", header.getvalue() + bytes(40))
    np.savez(tmp_path / "other.npz", means=np.zeros((1, 3)))
    np.save(tmp_path / "array.npy", np.zeros(3))
    np.savez(tmp_path / "short.npz", allow_pickle=False, **(arrays | {"quats": np.zeros((2, 4))}))
    pickled = {name: np.array([{"a": 1}], dtype=object) for name in FIELDS}
    np.savez(tmp_path / "pickle.npz", allow_pickle=True, **pickled)
    broken = [data[: int(share * len(data))] for share in (0.0, 0.2, 0.6, 0.99)]
    for number, content in enumerate([*broken, data[:half] + bytes(50) + data[half + 50 :], b"hi"]):
        (tmp_path / f"broken{number}.npz").write_bytes(content)
    for number, note in enumerate(([np.nan, 0.0], [-1.0, 0.0], [1e9, 0.0], [0.3])):
        np.savez(tmp_path / f"note{number}.npz", **arrays, screen_filter=np.array(note))
    messages = {
        "gone.npz": "no such file",
        "other.npz": "log_scales",
        "short.npz": r"quats: shape \(2, 4\), expected \(1000, 4\)",
        "promise.npz": "Unable to allocate",
        **{f"note{number}.npz": "expected" for number in range(4)},
    }
    for name in {*messages, *(each.name for each in tmp_path.iterdir())} - {"g.npz"}:
        with pytest.raises(DigsError, match=f"{name}.*{messages.get(name, '')}"):
            Gaussians.load(tmp_path / name)


def test_a_file_says_what_the_splats_are_drawn_with(tmp_path: Path) -> None:
    for made_for in (NO_FILTER, CLASSIC, ANTIALIASED, ScreenFilter(0.001)):
        gaussians = replace(random_gaussians(4), screen_filter=made_for)
        gaussians.save(tmp_path / "g.npz")
        assert Gaussians.load(tmp_path / "g.npz").screen_filter == made_for
        assert gaussians.select(slice(2)).screen_filter == made_for
        assert DeviceGaussians.from_numpy(gaussians).to_numpy().screen_filter == made_for
        assert joined([gaussians, gaussians]).screen_filter == made_for
    # An older file, without a note, is for the dilation of that time.
    np.savez(tmp_path / "g.npz", **{name: getattr(gaussians, name) for name in FIELDS})
    assert Gaussians.load(tmp_path / "g.npz").screen_filter == CLASSIC


def test_colors_of_any_kind_are_shares_of_one(tmp_path: Path, caplog) -> None:
    for kind, top, half in (
        *(("uchar", 255, 128), ("ushort", 65535, 32768)),
        *(("float", 1, 0.5), ("float", 255, 128)),
    ):
        colors = "".join(f"property {kind} {name}\n" for name in ("red", "green", "blue"))
        places = "".join(f"property float {axis}\n" for axis in "xyz")
        rows = f"1 2 3 {top} 0 {half}\nnan 0 0 0 0 0\n"
        header = f"ply\nformat ascii 1.0\nelement vertex 2\n{places}{colors}end_header\n"
        (tmp_path / "a.ply").write_text(header + rows)
        cloud = read_points(tmp_path / "a.ply", offset=np.ones(3), scale=0.5)
        np.testing.assert_array_equal(cloud.points_world, [[1, 3, 5]])
        np.testing.assert_allclose(cloud.colors, [[1, 0, 0.5]], atol=0.002)
    assert "1 of 2 are not finite and are left out" in caplog.text


Posed = tuple[Capture, PosedFrames, Path]


@pytest.fixture
def posed(tmp_path: Path) -> Posed:
    """A capture, the frames with one camera moved and one mask replaced, and the folder they lie in."""
    capture = write_tiny_capture(tmp_path / "capture", frames=4)
    training, held_out = capture.split(2)
    moved = training[0].camera.world_from_cam.copy()
    moved[:3, 3] += 0.25
    mask = tmp_path / "reconstruction" / "masks" / "a.png"
    camera = replace(training[0].camera, world_from_cam=moved)
    training[0] = replace(training[0], camera=camera).with_layer(Layer.MASK, mask)
    frames = PosedFrames(tuple(training), tuple(held_out), sfm_per_metre=2.5)
    return capture, frames, tmp_path / "reconstruction"


def test_what_was_saved_is_read(posed: Posed) -> None:
    capture, frames, folder = posed
    frames.save(folder)
    found = PosedFrames.load(capture, folder)
    assert found.sfm_per_metre == 2.5
    for group in ("training", "held_out"):
        for a, b in zip(getattr(found, group), getattr(frames, group), strict=True):
            assert a.name == b.name
            assert a.layers == b.layers
            np.testing.assert_array_equal(a.camera.world_from_cam, b.camera.world_from_cam)


def test_the_folder_can_be_moved_and_another_capture_or_a_broken_file_is_refused(
    posed: Posed,
) -> None:
    capture, frames, folder = posed
    frames.save(folder)
    elsewhere = folder.rename(folder.with_name("elsewhere"))
    found = PosedFrames.load(capture, elsewhere)
    assert found.training[0].path(Layer.MASK) == elsewhere / "masks" / "a.png"
    with pytest.raises(DigsError, match="capture"):
        PosedFrames.load(replace(capture, frames=capture.frames[:2]), elsewhere)
    for entries, message in (
        (None, "reconstruct again"),
        ([{"name": "0000"}], "has no .*reconstruct again"),
        ([{"name": "0000", "world_from_cam": "x", "held_out": False}], "reconstruct again"),
    ):
        record = json.loads((elsewhere / CAMERAS).read_text()) | {"frames": entries}
        (elsewhere / CAMERAS).write_text(json.dumps(record))
        with pytest.raises(DigsError, match=message):
            PosedFrames.load(capture, elsewhere)


# pycocotools.mask.encode of `framed`.
FRAMED = (
    "01d<k0hC00000000000000000000000000000000000000CII77II77II77II77II77II77II77II77II77II7d000"
    "000000000000000000000000000000000000[<"
)


def framed() -> np.ndarray:
    mask = np.zeros((40, 70), bool)
    mask[5:33, 10:60] = True
    mask[20:25, 30:40] = False
    mask[0, 0] = True
    return mask


def test_the_text_is_that_of_coco() -> None:
    assert text_of_mask(framed()) == FRAMED
    np.testing.assert_array_equal(mask_of_text(FRAMED, 40, 70), framed())


def test_any_mask_comes_back_and_text_of_another_is_refused() -> None:
    for share in (0.0, 0.02, 0.5, 1.0):
        mask = np.random.default_rng(1).random((37, 211)) < share
        np.testing.assert_array_equal(mask_of_text(text_of_mask(mask), 37, 211), mask)
    for text in ("", FRAMED[:-1], "P", "~", FRAMED + "1"):
        with pytest.raises(ValueError, match=r"pixels|character|ends"):
            mask_of_text(text, 40, 70)
