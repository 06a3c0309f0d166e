"""The files that the writer leaves: their bytes and members, and what happens to those that are there."""

from pathlib import Path

import pytest

from digs_warp.checks import UsdError
from digs_warp.usd import files
from digs_warp.usd.writer import write_gaussians
from reference.full_disk import largest_file
from reference.usd_files import run_fresh


def test_same_input_gives_the_same_bytes_in_another_process(tmp_path: Path, random_gaussians):
    gaussians = random_gaussians(300)
    gaussians.save(tmp_path / "gaussians.npz")
    metadata = {"b": 1, "a": {"d": [1.5], "c": "text"}}
    write_gaussians(tmp_path / "here.usdz", gaussians, metadata)
    # Another time zone: packages must not carry local times.
    run_fresh(
        "from pathlib import Path; from digs_warp.data.gaussians import Gaussians\n"
        "from digs_warp.usd.writer import write_gaussians\n"
        f"folder = Path({str(tmp_path)!r}); gaussians = Gaussians.load(folder / 'gaussians.npz')\n"
        f"write_gaussians(folder / 'there.usdz', gaussians, {metadata!r})\n",
        TZ="Asia/Tokyo",
    )
    assert (tmp_path / "here.usdz").read_bytes() == (tmp_path / "there.usdz").read_bytes()


@pytest.mark.parametrize("suffix", [".usda", ".usdc", ".usdz"])
def test_a_write_that_runs_out_of_space_leaves_the_old_file(
    tmp_path: Path, random_gaussians, suffix: str
):
    path = tmp_path / f"scene{suffix}"
    write_gaussians(path, random_gaussians(3))
    before = path.read_bytes()
    with largest_file(100_000), pytest.raises(UsdError, match=rf"scene\{suffix}.*too large"):
        write_gaussians(path, random_gaussians(2000))
    assert path.read_bytes() == before
    assert [*tmp_path.iterdir()] == [path]


def test_what_cannot_be_written_is_refused_and_leaves_nothing(
    tmp_path: Path, random_gaussians, monkeypatch
):
    with pytest.raises(UsdError, match=r"expected one of \.usda, \.usdc, \.usdz"):
        write_gaussians(tmp_path / "scene", random_gaussians(1))
    monkeypatch.setattr(files, "MAX_PACKAGE", 1000)
    with pytest.raises(UsdError, match=r"scene.usdz': \d+ bytes do not fit.*write a \.usdc"):
        write_gaussians(tmp_path / "scene.usdz", random_gaussians(100))
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "scene.usdc").mkdir()
    with pytest.raises(UsdError, match=r"scene\.usdc.*cannot be written"):
        write_gaussians(tmp_path / "scene.usdc", random_gaussians(1))
    assert [path.name for path in tmp_path.iterdir()] == ["scene.usdc"]
