"""Recorded walks: their moments, their distances, and what the camera can record by its size."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from digs_warp.checks import DigsError
from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.camera.walk.paths import fitting_distance
from digs_warp.sim.camera.walk.settings import PathName, WalkSettings
from digs_warp.sim.camera.working_range import camera_distance
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.inputs import load_inputs
from digs_warp.sim.record.record import simulate
from digs_warp.sim.record.session import Session, prepare_session
from reference.mesh_files import save

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


def test_a_film_has_the_poses_of_its_moments(tmp_path: Path) -> None:
    capture = simulate(CONFIG, tmp_path)
    session = session_of(CONFIG)
    assert len(capture) == CONFIG.frame_count == 6
    assert [frame.time for frame in capture.frames] == pytest.approx(np.arange(6) / 30)
    spread = session_of(replace(CONFIG, frames=5, walk=replace(FILM, fps=None)))
    assert spread.moments == pytest.approx(0.2 * np.arange(5) / 5)
    for frame, moment in zip(capture.frames, session.moments, strict=True):
        np.testing.assert_allclose(frame.camera.world_from_cam, session.walk.pose(moment))


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


def test_rate_and_duration_give_the_number_of_frames_and_two_of_three_are_enough() -> None:
    assert SimulateConfig().frame_count == 60
    assert SimulateConfig(frames=7).frame_count == 7
    assert SimulateConfig(walk=WalkSettings(fps=30.0)).frame_count == 60
    both = WalkSettings(fps=30.0, duration=4.0)
    assert SimulateConfig(walk=both).frame_count == 120
    with pytest.raises(DigsError, match=r"--frames 9, --fps 30 and --duration 4: .* leave one out"):
        SimulateConfig(frames=9, walk=both)
    with pytest.raises(DigsError, match=r"--fps 1000 for --duration 1000: --frames: 1000000"):
        SimulateConfig(walk=WalkSettings(fps=1000.0, duration=1000.0))
    with pytest.raises(DigsError, match=r"--fps 0.1 for --duration 1: --frames: 0"):
        SimulateConfig(walk=WalkSettings(fps=0.1, duration=1.0))


def box(folder: Path, longest: float) -> Path:
    extents = longest * np.array([0.8, 1.0, 0.6])
    return save(folder / "box.glb", trimesh.creation.box(extents=extents))


@pytest.mark.parametrize("longest", [0.4, 3.0])
def test_an_object_that_the_camera_can_measure_fills_the_image(
    tmp_path: Path, longest: float, caplog: pytest.LogCaptureFixture
) -> None:
    config = SimulateConfig(profile="bare-matcher", mesh=box(tmp_path, longest), frames=1, width=64)
    inputs = load_inputs(config)
    session = prepare_session(config, inputs)
    fitting = fitting_distance(inputs.scene.radius, inputs.rig.intrinsics)
    away = np.linalg.norm(session.walk.eyes, axis=1)
    assert np.median(away) == pytest.approx(fitting, rel=0.05)
    assert session.environment.radius >= 1.75 * away.max()
    assert not caplog.records


@pytest.mark.parametrize(
    ("profile", "longest", "seen_from", "warning"),
    [
        # At its nearest the center is the nearest depth and 1.2 radii away, on the path 6 % more.
        (
            "oak-d",
            0.08,
            lambda r, rig: np.exp(0.06) * (rig.min_depth + 1.2 * r),
            "spans 87 of 1280 x 800 px: nearer",
        ),
        # As both eyes ask for.
        (
            *("bare-matcher", 0.08),
            lambda r, rig: fitting_distance(r, rig.image_intrinsics, baseline=rig.baseline),
            "where it spans",
        ),
        ("bare-matcher", 9.0, None, "0.3 to 20 m; only its near parts get depth"),
        ("bare-matcher", 12.0, lambda r, rig: 20.0, ""),  # would be out of reach: from nearer
    ],
)
def test_objects_of_other_sizes_are_seen_from_where_it_is_best_with_a_warning(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, profile: str, longest: float,
    seen_from: Callable[[float, StereoRig], float] | None, warning: str,
) -> None:  # fmt: skip
    config = SimulateConfig(mesh=box(tmp_path, longest), frames=1, profile=profile)
    inputs = load_inputs(config)
    assert warning in caplog.text
    if seen_from is not None:
        expected = seen_from(inputs.scene.radius, inputs.rig)
        assert camera_distance(inputs.scene, inputs.rig, config.walk) == pytest.approx(expected)


def test_an_object_beyond_the_farthest_depth_is_refused_before_rendering(tmp_path: Path) -> None:
    config = SimulateConfig(profile="bare-matcher", mesh=box(tmp_path, 111.0), frames=1)
    with pytest.raises(
        DigsError, match=r"object of 111 m: .*0\.3 to 20 m.*glTF is in metres.*--mesh-unit"
    ):
        simulate(config, tmp_path / "capture")
    assert not (tmp_path / "capture").exists()
