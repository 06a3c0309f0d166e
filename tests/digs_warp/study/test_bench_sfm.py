"""The benchmark of structure from motion: every choice is one, and a failed case is a row, no crash."""

from pathlib import Path

import numpy as np
import pytest

from digs_warp.data.frame import Frame
from digs_warp.data.images import write_image
from digs_warp.data.layers import Layer
from digs_warp.geometry.camera import Camera
from digs_warp.study.bench_sfm import CHOICES, DEFAULT, run_case, sensors
from digs_warp.study.sfm_photographs import (
    IDEAL,
    Photographs,
    only,
    photograph_walk,
    planned_sensor,
)
from reference.sfm_views import INTRINSICS, arc


def test_every_choice_changes_the_default() -> None:
    names = [name for name, _ in CHOICES]
    assert len(set(names)) == len(names) and CHOICES[0] == ("default", {})
    for _, change in CHOICES[1:]:
        assert all(getattr(DEFAULT, key) != value for key, value in change.items())


def test_images_that_cannot_be_placed_are_a_row_of_the_table(tmp_path: Path) -> None:
    frames = []
    for number, pose in enumerate(arc(3)):
        path = tmp_path / f"{number}.png"
        write_image(path, np.full((240, 320, 3), 90, np.uint8))
        frames.append(Frame(path.stem, Camera(INTRINSICS, pose), 0.0, {Layer.IMAGE: path}))
    numbers = run_case(frames, DEFAULT, tmp_path / "workspace")
    assert numbers["registered [images]"] == 0
    assert numbers["total [s]"] > 0


def test_a_walk_is_photographed_once_and_goes_on_where_it_stopped(tmp_path: Path) -> None:
    session = Photographs(3, 64, 36).session()
    frames = photograph_walk(session, tmp_path)
    assert [frame.time for frame in frames] == pytest.approx(session.moments)
    for frame, moment in zip(frames, session.moments, strict=True):
        np.testing.assert_allclose(frame.camera.world_from_cam, session.walk.pose(moment))
    whole = [frame.load_image() for frame in frames]
    first, last = frames[0].path(Layer.IMAGE), frames[2].path(Layer.IMAGE)
    last.unlink()
    (tmp_path / "transforms.json").unlink()
    write_image(first, np.zeros((36, 64, 3), np.uint8))  # to see that it is not photographed again
    again = photograph_walk(session, tmp_path)
    assert not again[0].load_image().any()
    np.testing.assert_array_equal(again[2].load_image(), whole[2])


def test_every_sensor_of_the_comparison_takes_other_photographs(tmp_path: Path) -> None:
    session = Photographs(3, 64, 36).session()
    # So small an image shows neither shutter nor blur: the scene would call for neither.
    names = ("rolling-shutter", "image-blur", "shot-noise", "read-noise")
    planned = only(planned_sensor(session), frozenset(names))
    images = {}
    for name, sensor in [*sensors(planned), ("ideal again", IDEAL)]:
        frames = photograph_walk(session, tmp_path / name, sensor)
        images[name] = np.stack([frame.load_image() for frame in frames])
    np.testing.assert_array_equal(images.pop("ideal again"), images["ideal camera"])
    assert len({pixels.tobytes() for pixels in images.values()}) == len(images) == 8
    on = set(planned.effects_on)
    for name, sensor in sensors(planned):
        left_out = name.startswith("without")
        assert set(sensor.effects_on) < on if left_out else set(sensor.effects_on) <= on
