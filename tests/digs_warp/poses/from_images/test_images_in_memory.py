"""Structure from motion of a recording in memory: COLMAP gets files with the same pixels."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from digs_warp.data.layers import Layer
from digs_warp.poses.from_images.config import SfmConfig
from digs_warp.poses.from_images.workspace import key_of, with_image_files
from reference.noise_capture import write_capture


def test_images_in_memory_get_files_with_the_same_bytes(tmp_path: Path) -> None:
    stored = write_capture(tmp_path / "capture").frames
    in_memory = [replace(f, layers={Layer.IMAGE: f.load_image()}) for f in stored]
    written = with_image_files(in_memory, tmp_path / "images")
    assert {frame.path(Layer.IMAGE).parent for frame in written} == {tmp_path / "images"}
    for frame, there in zip(written, stored, strict=True):
        np.testing.assert_array_equal(frame.load_image(), there.load_image())
    assert key_of(written, SfmConfig()) == key_of(stored, SfmConfig())


def test_images_with_files_stay_where_they_are(tmp_path: Path) -> None:
    stored = write_capture(tmp_path / "capture").frames
    assert with_image_files(stored, tmp_path / "images") == list(stored)
    assert not (tmp_path / "images").exists()
