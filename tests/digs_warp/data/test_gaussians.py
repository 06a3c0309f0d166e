"""Gaussians: exact files, errors that name them, and activation at the extremes."""

import io
import warnings
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.gaussians import (
    ANTIALIASED,
    CLASSIC,
    FIELDS,
    NO_FILTER,
    Gaussians,
    ScreenFilter,
    joined,
)
from digs_warp.splat.device import DeviceGaussians


def random_gaussians(count: int, sh_degree: int = 1) -> Gaussians:
    rng = np.random.default_rng(count)
    return Gaussians(
        means=rng.normal(size=(count, 3)),
        log_scales=rng.normal(size=(count, 3)),
        quats=rng.normal(size=(count, 4)),
        opacity_logits=rng.normal(size=count),
        sh=rng.normal(size=(count, (sh_degree + 1) ** 2, 3)),
    )


@pytest.mark.parametrize(("count", "sh_degree"), [(0, 3), (1, 0), (100, 1), (100, 2), (100, 3)])
def test_what_is_saved_is_loaded(tmp_path: Path, count: int, sh_degree: int) -> None:
    gaussians = random_gaussians(count, sh_degree)
    gaussians.save(tmp_path / "g.npz")
    loaded = Gaussians.load(tmp_path / "g.npz")
    assert loaded.sh_degree == sh_degree
    for name in FIELDS:
        assert getattr(loaded, name).dtype == np.float32
        np.testing.assert_array_equal(getattr(loaded, name), getattr(gaussians, name))
    assert [path.name for path in tmp_path.iterdir()] == ["g.npz"]


@pytest.mark.parametrize("share", [0.0, 0.2, 0.6, 0.99])
def test_a_truncated_file_is_named(tmp_path: Path, share: float) -> None:
    path = tmp_path / "g.npz"
    random_gaussians(100).save(path)
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    with pytest.raises(DigsError, match=r"g\.npz"):
        Gaussians.load(path)


def test_damage_inside_a_file_is_named(tmp_path: Path) -> None:
    path = tmp_path / "g.npz"
    random_gaussians(1000).save(path)
    data = bytearray(path.read_bytes())
    data[len(data) // 2 : len(data) // 2 + 50] = bytes(50)
    path.write_bytes(data)
    with pytest.raises(DigsError, match=r"g\.npz"):
        Gaussians.load(path)


def test_foreign_files_are_named(tmp_path: Path) -> None:
    with pytest.raises(DigsError, match="no such file"):
        Gaussians.load(tmp_path / "g.npz")
    np.savez(tmp_path / "other.npz", means=np.zeros((1, 3)))
    with pytest.raises(DigsError, match=r"other\.npz.*log_scales"):
        Gaussians.load(tmp_path / "other.npz")
    np.save(tmp_path / "array.npy", np.zeros(3))
    with pytest.raises(DigsError, match=r"array\.npy"):
        Gaussians.load(tmp_path / "array.npy")
    arrays = {name: getattr(random_gaussians(3), name) for name in FIELDS}
    np.savez(tmp_path / "short.npz", allow_pickle=False, **(arrays | {"quats": np.zeros((2, 4))}))
    with pytest.raises(DigsError, match=r"short\.npz.*quats: shape \(2, 4\), expected \(3, 4\)"):
        Gaussians.load(tmp_path / "short.npz")
    (tmp_path / "text.npz").write_text("hello")
    with pytest.raises(DigsError, match=r"text\.npz"):
        Gaussians.load(tmp_path / "text.npz")


def test_a_file_with_pickled_objects_is_not_run(tmp_path: Path) -> None:
    arrays = {name: np.array([{"a": 1}], dtype=object) for name in FIELDS}
    np.savez(tmp_path / "pickle.npz", allow_pickle=True, **arrays)
    with pytest.raises(DigsError, match=r"pickle\.npz"):
        Gaussians.load(tmp_path / "pickle.npz")


def test_opacity_of_extreme_logits_is_finite_and_silent() -> None:
    for logit, opacity in [
        (-np.inf, 0.0),
        (-1e4, 0.0),
        (-100.0, 0.0),
        (0.0, 0.5),
        (100.0, 1.0),
        (1e4, 1.0),
        (np.inf, 1.0),
    ]:
        gaussians = Gaussians(
            np.zeros((1, 3)),
            np.zeros((1, 3)),
            np.zeros((1, 4)),
            np.array([logit]),
            np.zeros((1, 1, 3)),
        )
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            assert gaussians.opacities.tolist() == [pytest.approx(opacity, abs=1e-40)]


@pytest.mark.parametrize("name", FIELDS)
def test_a_wrong_shape_is_named(name: str) -> None:
    arrays = {field: getattr(random_gaussians(5), field) for field in FIELDS}
    arrays[name] = np.zeros((5, 2))
    with pytest.raises(DigsError, match=r"Gaussians\.\w+: shape|spherical harmonics"):
        Gaussians(*arrays.values())


@pytest.mark.parametrize("shape", [(5, 5, 3), (5, 0, 3), (5, 25, 3), (5, 3), (5,)])
def test_a_wrong_number_of_color_coefficients_raises_our_error(shape: tuple[int, ...]) -> None:
    arrays = {field: getattr(random_gaussians(5), field) for field in FIELDS}
    with pytest.raises(DigsError):
        Gaussians(*(arrays | {"sh": np.zeros(shape)}).values())


def test_a_file_that_promises_terabytes_is_refused(tmp_path: Path) -> None:
    header = io.BytesIO()
    promise = {"descr": "<f4", "fortran_order": False, "shape": (10**13, 3)}
    np.lib.format.write_array_header_1_0(header, promise)
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        for name in FIELDS:
            archive.writestr(f"{name}.npy", header.getvalue() + bytes(40))
    with pytest.raises(DigsError, match=r"a\.npz.*promises 120,000,000,000,000 bytes"):
        Gaussians.load(tmp_path / "a.npz")


@pytest.mark.parametrize("made_for", [NO_FILTER, CLASSIC, ANTIALIASED, ScreenFilter(0.001)])
def test_a_file_says_what_the_splats_are_drawn_with(tmp_path: Path, made_for: ScreenFilter) -> None:
    gaussians = replace(random_gaussians(4), screen_filter=made_for)
    gaussians.save(tmp_path / "g.npz")
    assert Gaussians.load(tmp_path / "g.npz").screen_filter == made_for
    assert gaussians.select(slice(2)).screen_filter == made_for
    assert DeviceGaussians.from_numpy(gaussians).to_numpy().screen_filter == made_for
    assert joined([gaussians, gaussians]).screen_filter == made_for


def test_an_older_file_is_for_the_dilation_that_we_trained_with_then(tmp_path: Path) -> None:
    gaussians = random_gaussians(4)
    np.savez(tmp_path / "g.npz", **{name: getattr(gaussians, name) for name in FIELDS})
    assert Gaussians.load(tmp_path / "g.npz").screen_filter == CLASSIC


@pytest.mark.parametrize("note", [[np.nan, 0.0], [-1.0, 0.0], [1e9, 0.0], [0.3]])
def test_a_damaged_note_is_named(tmp_path: Path, note: list[float]) -> None:
    arrays = {name: getattr(random_gaussians(4), name) for name in FIELDS}
    np.savez(tmp_path / "g.npz", **arrays, screen_filter=np.array(note))
    with pytest.raises(DigsError, match=r"g\.npz.*expected"):
        Gaussians.load(tmp_path / "g.npz")


def test_splats_for_different_renderers_are_not_mixed() -> None:
    ours = random_gaussians(2)
    with pytest.raises(DigsError, match="different renderers"):
        joined([ours, replace(ours, screen_filter=CLASSIC)])
