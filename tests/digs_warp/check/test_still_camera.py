"""A camera at rest before which things change is noticed; one that moves is not."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from digs_warp.check.full_check import check_fully
from digs_warp.check.still_camera import AT_REST, CHANGED, still_camera, stillness, thumbnail
from digs_warp.data.capture import Capture
from digs_warp.data.images import read_image
from digs_warp.sim.camera.walk.settings import WalkSettings
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.record import simulate_in_memory

MARGIN = 1.2
SHAPES = (0, 1, 2, 3, 4, 5)


@pytest.fixture(scope="module")
def exchanged() -> Capture:
    """A camera on a tripod: in each frame, other things stand beside the object."""
    walk = WalkSettings(path="hover", unsteadiness=0.0, shake=0.0, distance=1.5)
    frames = []
    for seed in SHAPES:
        capture = simulate_in_memory(
            SimulateConfig(
                frames=2,
                width=160,
                height=90,
                samples_per_pixel=2,
                distractors=2,
                seed=seed,
                walk=walk,
            )
        )
        frames.append(replace(capture.frames[0], name=f"{seed:04}", time=float(seed)))
    return replace(capture, frames=tuple(frames))


def without_poses(capture: Capture) -> Capture:
    return replace(capture, about=replace(capture.about, poses_known=False))


def test_things_that_change_before_a_camera_at_rest_are_noticed(exchanged: Capture) -> None:
    found = {each.kind: each for each in check_fully(exchanged).findings}
    assert not found["still camera"].is_error
    assert still_camera(without_poses(exchanged)) != []


def test_a_camera_at_rest_before_nothing_new_only_repeats(exchanged: Capture) -> None:
    resting = replace(exchanged, frames=tuple(exchanged.frames[0] for _ in SHAPES))
    assert still_camera(resting) == []


def test_a_camera_that_moves_is_not_at_rest() -> None:
    config = SimulateConfig(frames=12, width=160, height=90, samples_per_pixel=1)
    assert still_camera(without_poses(simulate_in_memory(config))) == []


def test_objects_exchanged_below_a_real_camera_are_noticed(sample_data: Path) -> None:
    folder = sample_data / "rgbd" / "primesense_single_object"
    looks = [thumbnail(read_image(path, "image")) for path in sorted(folder.glob("color_*.png"))]
    found = [stillness(a, b) for a, b in pairwise(looks)]
    told = [each for each in found if each is not None]
    assert np.median([each.stayed for each in told]) > MARGIN * AT_REST
    assert np.median([each.changed for each in told]) > MARGIN * CHANGED
