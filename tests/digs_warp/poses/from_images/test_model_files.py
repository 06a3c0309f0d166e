"""COLMAP's models on disk: complete, or an error and the old one."""

from pathlib import Path

import pytest

from digs_warp.checks import DigsError
from digs_warp.device.libraries import import_pycolmap
from digs_warp.geometry.camera import Intrinsics
from digs_warp.poses.from_images.colmap import ImageSet, extract_features
from digs_warp.poses.from_images.config import SfmConfig
from digs_warp.poses.from_images.workspace import FILES, is_complete, write_model
from reference.full_disk import largest_file, small_disk


def test_colmap_is_not_called_without_room_for_its_database(tmp_path: Path) -> None:
    """It would end the process."""
    images = ImageSet(tmp_path, ("a.png",), (Intrinsics.from_fov(32, 24, 60.0),))
    with small_disk(tmp_path / "disk", 1 << 20) as folder:
        with pytest.raises(DigsError, match=r"database\.db': cannot be written .*needs 17"):
            extract_features(images, SfmConfig(), 1, folder / "database.db")
        assert list(folder.iterdir()) == []


def test_a_model_that_does_not_fit_on_the_disk_leaves_the_old_one(tmp_path: Path) -> None:
    pycolmap = import_pycolmap()
    options = pycolmap.SyntheticDatasetOptions()
    options.num_points3D = 50
    model = pycolmap.synthesize_dataset(options)
    folder = tmp_path / "model"
    write_model(model, folder)
    before = {name: (folder / name).read_bytes() for name in FILES}
    largest = max(map(len, before.values()))
    for size in (0, 1, 100, len(before["points3D.bin"]) - 1, largest // 2, largest - 1):
        with largest_file(size), pytest.raises(DigsError, match=r"cannot be written .*Free space"):
            write_model(model, folder)
        assert {name: (folder / name).read_bytes() for name in FILES} == before
        assert list(tmp_path.iterdir()) == [folder]
    (folder / "rigs.bin").unlink()
    assert not is_complete(folder)
    write_model(model, folder)
    assert is_complete(folder)
