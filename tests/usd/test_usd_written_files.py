"""The files that the writer leaves: their bytes and members, and what happens to those that are there."""

import hashlib
from pathlib import Path

import pytest

from digs_warp.checks import UsdError
from digs_warp.usd import files
from digs_warp.usd.writer import write_gaussians
from reference.usd_files import SUFFIXES, error_of_a_full_disk, run_fresh


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_same_input_gives_the_same_bytes_in_another_process(
    tmp_path: Path, random_gaussians, suffix: str
):
    gaussians = random_gaussians(300)
    gaussians.save(tmp_path / "gaussians.npz")
    here = tmp_path / f"here{suffix}"
    write_gaussians(here, gaussians, {"b": 1, "a": {"d": [1.5], "c": "text"}})
    there = tmp_path / f"there{suffix}"
    program = (
        "from pathlib import Path; from digs_warp.data.gaussians import Gaussians\n"
        "from digs_warp.usd.writer import WriteOptions, write_gaussians\n"
        f"gaussians = Gaussians.load(Path({str(tmp_path / 'gaussians.npz')!r}))\n"
        f"write_gaussians(Path({str(there)!r}), gaussians,"
        " {'b': 1, 'a': {'d': [1.5], 'c': 'text'}})\n"
    )
    # Another time zone: packages must not carry local times.
    run_fresh(program, TZ="Asia/Tokyo")
    assert_same_bytes(here, there)


def test_files_of_the_same_name_and_other_suffixes_are_left_alone(tmp_path: Path, random_gaussians):
    others = [tmp_path / name for name in ("scene.usda", "scene.usdc", "default.usdc", "scene")]
    for path in others:
        path.write_bytes(b"mine")
    write_gaussians(tmp_path / "scene.usdz", random_gaussians(3))
    assert all(path.read_bytes() == b"mine" for path in others)
    assert {path.name for path in tmp_path.iterdir()} == {
        "scene.usdz",
        *(path.name for path in others),
    }


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_write_that_runs_out_of_space_leaves_the_old_file(
    tmp_path: Path, random_gaussians, suffix: str
):
    path = tmp_path / f"scene{suffix}"
    write_gaussians(path, random_gaussians(3))
    before = path.read_bytes()
    random_gaussians(2000).save(tmp_path / "gaussians.npz")
    message = error_of_a_full_disk(
        "from digs_warp.data.gaussians import Gaussians\n"
        "from digs_warp.usd.writer import write_gaussians\n"
        f"gaussians = Gaussians.load(Path({str(tmp_path / 'gaussians.npz')!r}))",
        f"write_gaussians(Path({str(path)!r}), gaussians)",
    )
    assert f"scene{suffix}" in message and "too large" in message
    assert path.read_bytes() == before
    assert {entry.name for entry in tmp_path.iterdir()} == {path.name, "gaussians.npz"}


def test_a_folder_in_the_place_of_the_file_is_an_error(tmp_path: Path, random_gaussians):
    (tmp_path / "scene.usdc").mkdir()
    with pytest.raises(UsdError, match=r"scene\.usdc.*cannot be written"):
        write_gaussians(tmp_path / "scene.usdc", random_gaussians(1))
    assert [path.name for path in tmp_path.iterdir()] == ["scene.usdc"]


@pytest.mark.parametrize("name", ["scene"])
def test_another_suffix_is_refused(tmp_path: Path, random_gaussians, name: str):
    with pytest.raises(UsdError, match=r"expected one of \.usda, \.usdc, \.usdz"):
        write_gaussians(tmp_path / name, random_gaussians(1))
    assert list(tmp_path.iterdir()) == []


def test_a_package_stays_below_its_limit(tmp_path: Path, random_gaussians, monkeypatch):
    monkeypatch.setattr(files, "MAX_PACKAGE", 1000)
    with pytest.raises(UsdError, match=r"scene.usdz': \d+ bytes do not fit.*write a \.usdc"):
        write_gaussians(tmp_path / "scene.usdz", random_gaussians(100))
    assert list(tmp_path.iterdir()) == []


def assert_same_bytes(first: Path, second: Path) -> None:
    digests = [hashlib.sha256(path.read_bytes()).hexdigest() for path in (first, second)]
    assert digests[0] == digests[1]
