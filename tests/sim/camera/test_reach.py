"""What a camera can record by its size: the nearest and the farthest depth."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from digs_warp.checks import DigsError
from digs_warp.sim.camera.walk.paths import fitting_distance
from digs_warp.sim.camera.working_range import camera_distance
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.inputs import load_inputs
from digs_warp.sim.record.record import simulate
from digs_warp.sim.record.session import prepare_session
from reference.mesh_files import save


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


def test_a_small_object_is_seen_from_the_nearest_depth_with_a_warning(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    config = SimulateConfig(mesh=box(tmp_path, 0.08), frames=1, profile="oak-d")
    inputs = load_inputs(config)
    rig = inputs.rig
    # At its nearest the center is the nearest depth and 1.2 radii away, on the path 6 % more.
    away = np.exp(0.06) * (rig.min_depth + 1.2 * inputs.scene.radius)
    spans = rig.image_intrinsics.fx * 0.08 / away
    expected = f"nearest depth of this camera is {rig.min_depth:g} m; an object of 8 cm spans "
    k = rig.image_intrinsics
    assert f"{expected}{spans:.0f} of {k.width} x {k.height} px" in caplog.text
    assert "a camera that measures nearer" in caplog.text


def test_a_small_object_is_as_far_away_as_both_eyes_ask_for_with_a_warning(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    config = SimulateConfig(profile="bare-matcher", mesh=box(tmp_path, 0.08), frames=1)
    inputs = load_inputs(config)
    k, baseline = inputs.rig.image_intrinsics, inputs.rig.baseline
    away = fitting_distance(inputs.scene.radius, k, baseline=baseline)
    assert away > fitting_distance(inputs.scene.radius, k)
    assert camera_distance(inputs.scene, inputs.rig, config.walk) == pytest.approx(away)
    expected = (
        f"both eyes of this camera see the object only from {away:.3g} m away; an object of 8 cm"
    )
    assert f"{expected} spans {k.fx * 0.08 / away:.0f} of 640 x 360 px" in caplog.text


def test_an_object_partly_beyond_the_farthest_depth_is_warned_of(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    load_inputs(SimulateConfig(profile="bare-matcher", mesh=box(tmp_path, 9.0), frames=1))
    assert "object of 9 m: fits the image from " in caplog.text
    assert "this camera measures 0.3 to 20 m; only its near parts get depth" in caplog.text


def test_an_object_that_would_be_out_of_reach_is_seen_from_nearer(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    config = SimulateConfig(profile="bare-matcher", mesh=box(tmp_path, 12.0), frames=1)
    inputs = load_inputs(config)
    assert fitting_distance(inputs.scene.radius, inputs.rig.intrinsics) > 20 + inputs.scene.radius
    assert camera_distance(inputs.scene, inputs.rig, config.walk) == 20
    assert (
        "object of 12 m: is recorded from 20 m away, where it is larger than the image"
        in caplog.text
    )


def test_an_object_beyond_the_farthest_depth_is_refused_before_rendering(tmp_path: Path) -> None:
    config = SimulateConfig(profile="bare-matcher", mesh=box(tmp_path, 111.0), frames=1)
    with pytest.raises(
        DigsError, match=r"object of 111 m: .*0\.3 to 20 m.*glTF is in metres.*--mesh-unit"
    ):
        simulate(config, tmp_path / "capture")
    assert not (tmp_path / "capture").exists()
