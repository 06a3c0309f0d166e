"""What a camera can record by its size: the nearest and the farthest depth."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh

from digs_warp.checks import DigsError
from digs_warp.sim.camera.rig import StereoRig
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
