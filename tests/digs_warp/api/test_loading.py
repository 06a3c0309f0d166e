"""`load` recognizes files by suffix and folders by what they hold."""

from pathlib import Path

import numpy as np
import pytest

import digs_warp as dw
from reference.splat_scenes import random_gaussians

GAUSSIANS = random_gaussians(5, seed=1)


def test_a_capture_folder_is_a_capture(capture_folder: Path) -> None:
    loaded = dw.load(str(capture_folder))
    assert isinstance(loaded, dw.Capture) and loaded.stored_in == capture_folder


@pytest.mark.parametrize(
    "name", ["a.npz", "a.ply", "a.spz", "a.splat", "a.usda", "a.usdz", "a.usd"]
)
def test_files_of_gaussians_are_gaussians(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    GAUSSIANS.save(path)
    start = {
        ".npz": b"PK",
        ".ply": b"ply\n",
        ".spz": b"\x1f\x8b",
        ".usda": b"#usda",
        ".usdz": b"PK",
    }
    assert path.read_bytes().startswith(start.get(path.suffix, b""))
    for loaded in (dw.load(path), dw.Gaussians.load(path)):
        assert isinstance(loaded, dw.Gaussians)
        centers = np.sort(loaded.means, axis=0)
        np.testing.assert_allclose(centers, np.sort(GAUSSIANS.means, axis=0), atol=1e-3)


def test_what_cannot_be_loaded_is_named(tmp_path: Path) -> None:
    with pytest.raises(dw.DigsError, match=r"gone': no such file or folder"):
        dw.load(tmp_path / "gone")
    (tmp_path / "mesh.obj").write_bytes(b"v 0 0 0")
    with pytest.raises(dw.DigsError, match=r"suffix '\.obj', expected Gaussians"):
        dw.load(tmp_path / "mesh.obj")
    with pytest.raises(dw.DigsError, match=r"no gaussians\.npz in it"):
        dw.load(tmp_path)
