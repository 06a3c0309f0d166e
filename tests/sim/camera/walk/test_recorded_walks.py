"""Recordings of walks that differ from the usual: their moments and their poses."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.sim.camera.walk.settings import PathName, WalkSettings
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.inputs import load_inputs
from digs_warp.sim.record.record import simulate
from digs_warp.sim.record.session import Session, prepare_session

FILM = WalkSettings(
    path="arc",
    elevations=(25.0,),
    fps=30.0,
    duration=0.2,
)
CONFIG = SimulateConfig(
    profile="bare-matcher", width=32, samples_per_pixel=1, tier="law", seed=2, walk=FILM
)


def session_of(config: SimulateConfig) -> Session:
    return prepare_session(config, load_inputs(config))


def test_a_film_has_the_poses_of_its_moments_and_resumes_to_the_same_bytes(tmp_path: Path) -> None:
    capture = simulate(CONFIG, tmp_path)
    session = session_of(CONFIG)
    assert len(capture) == CONFIG.frame_count == 6
    assert [frame.time for frame in capture.frames] == pytest.approx(np.arange(6) / 30)
    spread = session_of(replace(CONFIG, frames=5, walk=replace(FILM, fps=None)))
    assert spread.moments == pytest.approx(0.2 * np.arange(5) / 5)
    for frame, moment in zip(capture.frames, session.moments, strict=True):
        np.testing.assert_allclose(frame.camera.world_from_cam, session.walk.pose(moment))
    index = (tmp_path / "transforms.json").read_bytes()
    image = tmp_path / "images" / "0002.png"
    pixels = image.read_bytes()
    image.unlink()
    simulate(CONFIG, tmp_path, resume=True)
    assert image.read_bytes() == pixels
    assert (tmp_path / "transforms.json").read_bytes() == index


@pytest.mark.parametrize("path", ["orbits", "arc", "hover", "approach"])
@pytest.mark.parametrize("ground", ["floor", "table"])
def test_nothing_is_in_the_way_of_the_camera(path: PathName, ground: str) -> None:
    walk = WalkSettings(path=path, elevations=(10.0,), unsteadiness=2.0)
    config = replace(CONFIG, ground=ground, walk=walk)
    session = session_of(config)
    lowest = session.scene.object_vertices[:, 2].min()
    things = session.scene.vertices[session.scene.vertices[:, 2] > lowest + 0.001]
    reach = np.linalg.norm(things, axis=1).max()
    for moment in np.linspace(0, session.walk.end, 60):
        eye = session.walk.pose(float(moment))[:3, 3]
        assert session.environment.surround.holds(eye)
        assert eye[2] > lowest
        assert np.linalg.norm(eye) > reach


def test_a_distance_that_is_asked_for_is_kept_and_one_within_the_object_is_refused() -> None:
    walk = WalkSettings(distance=1.3, unsteadiness=0.0)
    away = np.linalg.norm(session_of(replace(CONFIG, walk=walk)).walk.eyes, axis=1)
    np.testing.assert_allclose(away, 1.3, rtol=1e-6)
    usual, farther = (
        np.median(np.linalg.norm(session_of(replace(CONFIG, walk=each)).walk.eyes, axis=1))
        for each in (WalkSettings(), WalkSettings(distance_factor=1.5))
    )
    # Paths of other lengths wander otherwise.
    assert farther / usual == pytest.approx(1.5, rel=0.1)
    with pytest.raises(
        DigsError, match=r"--camera-distance: 0\.2 m .* run into them; choose 0\.2\d+ m"
    ) as refused:
        load_inputs(replace(CONFIG, walk=WalkSettings(distance=0.2)))
    advised = float(str(refused.value).split("choose ")[1].split()[0])
    load_inputs(replace(CONFIG, walk=WalkSettings(distance=1.01 * advised)))
    with pytest.raises(DigsError, match="run into them"):
        load_inputs(replace(CONFIG, walk=WalkSettings(distance=0.98 * advised)))
