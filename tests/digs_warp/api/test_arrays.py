"""Recordings in memory, from arrays or simulated: as on disk, with what a caller adds."""

import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import digs_warp as dw
from digs_warp.data.gaussians import FIELDS
from digs_warp.geometry.sh import sh_from_rgb
from digs_warp.usd.reader import describe
from reference.sfm_views import arc, record

FRAMES, WIDTH = 6, 96
RECORDING: dict[str, Any] = {"profile": "bare-matcher", "frames": FRAMES, "width": WIDTH}


@pytest.fixture(scope="module")
def recorded() -> dw.Capture:
    return dw.simulate(**RECORDING)


@pytest.fixture
def arrays(recorded: dw.Capture) -> dict[str, Any]:
    frames = recorded.frames
    return {
        "color": [frame.load_image() for frame in frames],
        "depth": [frame.load_depth() for frame in frames],
        "poses": np.stack([frame.camera.world_from_cam for frame in frames]),
        "intrinsics": frames[0].camera.intrinsics,
        "masks": [frame.load_mask() for frame in frames],
        "confidence": [frame.load_confidence() for frame in frames],
    }


def test_arrays_are_the_recording(recorded: dw.Capture, arrays: dict[str, Any]) -> None:
    k = recorded.frames[0].camera.intrinsics.matrix
    floats: dict[str, Any] = {name: np.float64(arrays[name]) / 255 for name in ("color", "masks")}
    for given in (arrays, arrays | floats | {"intrinsics": k}):
        capture = dw.Capture.from_arrays(**given)
        assert len(capture) == FRAMES and capture.knows_poses and capture.has_depth
        for here, there in zip(capture.frames, recorded.frames, strict=True):
            for load in ("load_image", "load_depth", "load_mask", "load_confidence"):
                np.testing.assert_array_equal(getattr(here, load)(), getattr(there, load)())
            assert here.camera.intrinsics == there.camera.intrinsics
    same = [dw.reconstruct(each, iterations=3).gaussians for each in (capture, recorded)]
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(same[0], name), getattr(same[1], name))


def test_photographs_have_neither_depth_nor_poses(arrays: dict[str, Any]) -> None:
    capture = dw.Capture.from_arrays(arrays["color"], None, None, arrays["intrinsics"])
    assert not capture.has_depth and not capture.knows_poses
    assert capture._repr_html_().count("<img") == 1
    with pytest.raises(dw.DigsError, match="no camera poses"):
        dw.reconstruct(capture)


def test_far_places_are_brought_near(arrays: dict[str, Any]) -> None:
    arrays["poses"][:, :3, 3] += [5e5, 4e6, 0]
    capture = dw.Capture.from_arrays(**arrays)
    assert capture.about.world_offset is not None
    assert np.abs(capture.frames[0].camera.center_world).max() < 1000


@pytest.mark.parametrize(
    ("name", "wrong", "message"),
    [
        ("color", lambda v: v[:-1], f"{FRAMES} of depth, expected {FRAMES - 1} as of color"),
        ("color", lambda v: [], "no images"),
        ("color", lambda v: [np.float32(each) for each in v], "floats up to .*, expected 0 to 1"),
        (
            "color",
            lambda v: [each[:, :-1] for each in v],
            r"frame 0, left image: shape \(54, 95, 3\)",
        ),
        (
            "depth",
            lambda v: [np.uint16(1000 * np.nan_to_num(each)) for each in v],
            "expected floats",
        ),
        ("depth", lambda v: [each[..., None] for each in v], "frame 0, depth: shape"),
        ("poses", lambda v: 2 * v, "frame 0: camera: world_from_cam is not a rigid"),
        (
            "masks",
            lambda v: [each.astype(int) for each in v],
            "frame 0, mask: int64, expected uint8",
        ),
        ("intrinsics", lambda v: [v], f"1 of intrinsics, expected {FRAMES}"),
    ],
)
def test_wrong_arrays_are_named(arrays: dict[str, Any], name: str, wrong, message: str) -> None:
    with pytest.raises(dw.DigsError, match=message):
        dw.Capture.from_arrays(**arrays | {name: wrong(arrays[name])})


def test_a_term_of_the_caller_is_part_of_the_loss(recorded: dw.Capture) -> None:
    """A loss that wants red images makes them red; its images are whole, its value is in the course."""
    seen: list[dw.Frame] = []

    def blush(frame: dw.Frame, image: np.ndarray) -> tuple[float, np.ndarray]:
        assert image.shape == (54, WIDTH, 3) and 0 <= image.min() and image.max() <= 1.001
        seen.append(frame)
        wanted = np.array([1.0, 0.0, 0.0])
        return float(((image - wanted) ** 2).mean()), 100 * (image - wanted) / image.size

    settings: dict[str, Any] = {"iterations": 40, "strategy": "depth"}
    steps: list[int] = []
    plain = dw.reconstruct(recorded, callback=lambda step, _: steps.append(step), **settings)
    red = dw.reconstruct(recorded, loss=blush, **settings)
    color = [each.gaussians.sh[:, 0].mean(axis=0) for each in (plain, red)]
    assert color[1][0] > color[0][0] + 0.1 and color[1][1] < color[0][1] - 0.1
    assert (red.course[-1].loss or 0) > (plain.course[-1].loss or 0) + 0.1
    assert len(seen) == 40 and {frame.name for frame in seen} <= {f.name for f in recorded.frames}
    assert steps and steps[-1] == 40
    with pytest.raises(dw.DigsError, match="loss: the derivative: shape"):
        dw.reconstruct(recorded, loss=lambda frame, image: (0.0, image[0]), **settings)


def test_points_of_the_caller_are_the_start(recorded: dw.Capture) -> None:
    points = np.random.default_rng(0).uniform(-0.1, 0.1, (300, 6))
    points[:, 2:] += 0.1
    result = dw.reconstruct(recorded, points=points, iterations=0)
    assert result.start and result.start.sources == {"recorded": 300}
    np.testing.assert_allclose(result.gaussians.means, points[:, :3], atol=1e-6)
    colors = sh_from_rgb(points[:, 3:].astype(np.float32))
    kept = np.isclose(result.gaussians.sh[:, 0], colors, atol=1e-5).all(axis=1)
    assert kept.mean() > 0.5  # the others take the colors of the photographs
    with pytest.raises(dw.DigsError, match=r"points: shape \(300, 4\)"):
        dw.reconstruct(recorded, points=points[:, :4])
    for wrong in ({"poses": "sfm"}, {"strategy": "depth"}):
        with pytest.raises(dw.DigsError, match="leave out poses and strategy"):
            dw.reconstruct(recorded, points=points, **wrong)  # pyright: ignore[reportArgumentType]


def test_results_are_saved_by_suffix_replaced_on_request_and_short(
    recorded: dw.Capture, tmp_path: Path
) -> None:
    result = dw.reconstruct(recorded, out=tmp_path / "out", iterations=2)
    camera = recorded.frames[0].camera
    wanted = dw.render(result.gaussians, camera, background=(0.0, 0.0, 0.0))
    view = result.render(camera, background=(0.0, 0.0, 0.0))
    np.testing.assert_array_equal(view.image, wanted.image)
    for name in ("a.ply", "a.usdz", "a.usdc", "a.npz"):
        assert result.save(tmp_path / name) is result
        assert len(dw.load(tmp_path / name)) == len(result.gaussians)  # pyright: ignore
    result.save_usd(tmp_path / "b.usdz", recorded)
    assert describe(tmp_path / "b.usdz")["views"] == FRAMES
    with pytest.raises(dw.DigsError, match="suffix"):
        result.save(tmp_path / "a.obj")
    again = dw.reconstruct(recorded, out=tmp_path / "out", iterations=1, overwrite=True)
    assert again.folder == tmp_path / "out" and again.training.iterations == 1
    with pytest.raises(dw.DigsError, match="--overwrite"):
        dw.reconstruct(recorded, out=tmp_path / "out", iterations=1)
    for each in (recorded, result, again, result.gaussians):
        assert len(repr(each)) < 130 + len(str(tmp_path)) and each._repr_html_().startswith(
            "<div><img"
        )


# Depth is segmented and initialized from, half the images are held out: every layer and folder is used.
SETTINGS: dict[str, Any] = {"iterations": 12, "masks": "depth", "voxel_size": 0.02, "test_every": 2}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return dw.simulate(**RECORDING, out=tmp_path_factory.mktemp("front-door") / "capture").folder


def same(one: dw.Gaussians, other: dw.Gaussians) -> bool:
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in FIELDS)


def test_memory_and_folder_give_the_same_gaussians_and_only_out_is_left(
    recorded: dw.Capture, folder: Path, tmp_path: Path, monkeypatch
) -> None:
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    in_memory = dw.reconstruct(recorded, **SETTINGS)
    assert list(temporary.iterdir()) == []
    on_disk = dw.reconstruct(str(folder), out=tmp_path / "out", **SETTINGS)
    assert list(temporary.iterdir()) == []
    assert same(in_memory.gaussians, on_disk.gaussians) and len(on_disk.gaussians) > 50
    assert in_memory.scores.views == on_disk.scores.views and in_memory.folder is None
    assert in_memory.frames and on_disk.frames
    for here, there in zip(in_memory.frames.training, on_disk.frames.training, strict=True):
        np.testing.assert_array_equal(here.load_mask(), there.load_mask())
    loaded = dw.load(tmp_path / "out")
    assert isinstance(loaded, dw.Reconstruction)
    frame = next(dw.stream(**RECORDING))
    np.testing.assert_array_equal(frame.left, recorded.frames[0].load_image())
    assert same(loaded.gaussians, on_disk.gaussians) and loaded.scores.views == on_disk.scores.views


def test_structure_from_motion_reads_images_in_memory(tmp_path: Path) -> None:
    stored = record(arc(6), tmp_path / "capture")
    frames = [
        replace(
            frame,
            layers={
                dw.Layer.IMAGE: frame.load_image(),
                dw.Layer.DEPTH: frame.load_depth(),
                dw.Layer.MASK: frame.load_mask(),
            },
        )
        for frame in stored.frames
    ]
    capture = replace(stored, stored_in=None, frames=tuple(frames))
    out = tmp_path / "out"
    result = dw.reconstruct(capture, out, strategy="default", features=1500, iterations=0)
    assert len(result.gaussians) > 20
    assert len(list((out / "sfm" / "images").iterdir())) == len(capture)


def test_cards_escape_what_they_say_and_need_no_frames(
    recorded: dw.Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    result = dw.reconstruct(recorded, iterations=0)
    assert (
        replace(result, poses=replace(result.poses, frames=None))._repr_html_().count("<img") == 1
    )
    monkeypatch.setattr(dw.Gaussians, "__repr__", lambda _: "<b>&")
    assert "<small>&lt;b&gt;&amp;</small>" in result.gaussians._repr_html_()
    assert result.gaussians.select(slice(0))._repr_html_().count("<img") == 0
