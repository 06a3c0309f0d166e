"""`reconstruct --instance 2`: the second of two objects, and everything after it is held against that one."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from digs_warp.cli import EXIT_OK, main
from digs_warp.data.capture import read_capture
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.record import simulate
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.renderer import SplatRenderer
from digs_warp.surface.true_surface import read_true_surface
from reference.mesh_files import save

MM = 1e-3


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("two")
    boxes = (
        save(folder / "box.ply", trimesh.creation.box((0.2, 0.15, 0.12))),
        save(folder / "post.ply", trimesh.creation.box((0.08, 0.08, 0.2))),
    )
    config = SimulateConfig(
        profile="bare-matcher",
        scene=boxes,
        frames=16,
        width=128,
        tier="truth",
        unit="m",
        samples_per_pixel=1,
    )
    simulate(config, folder / "capture")
    return folder / "capture"


@pytest.fixture(scope="module")
def second(capture: Path) -> Path:
    folder = capture.parent / "second"
    flags = ["--instance", "2", "--iterations", "60", "--sh-degree", "0", "--quiet"]
    assert main(["reconstruct", str(capture), *flags, "--out", str(folder)]) == EXIT_OK
    return folder


def corners(capture: Path, instance: int) -> np.ndarray:
    surface = read_true_surface(capture, instance)
    assert surface is not None
    return np.stack([surface.points_world.min(axis=0), surface.points_world.max(axis=0)])


def test_start_and_gaussians_lie_on_the_second_object_alone(capture: Path, second: Path) -> None:
    result = Reconstruction.load(second)
    assert result.instance == 2
    assert result.start is not None
    low, high = corners(capture, 2)
    for points in (result.start.points.points_world, result.gaussians.means):
        beside = (points < low - 8 * MM) | (points > high + 8 * MM)
        assert np.mean(beside.any(axis=1)) < 0.02
        np.testing.assert_allclose(points.max(axis=0), high, atol=15 * MM)


def test_what_the_other_object_hides_is_not_taken_for_empty(capture: Path, second: Path) -> None:
    result = Reconstruction.load(second)
    assert result.frames is not None
    frames = [frame for frame, _ in result.frames.by_time]
    recorded = {frame.name: frame for frame in read_capture(capture).frames}
    splats = DeviceGaussians.from_numpy(result.gaussians)
    k = frames[0].camera.intrinsics
    renderer = SplatRenderer(splats, k.width, k.height)
    covered = []
    for frame in frames:
        numbers, unknown = recorded[frame.name].load_instances(), frame.load_unknown()
        assert unknown is not None
        np.testing.assert_array_equal(unknown, numbers == 1)
        hidden = recorded[frame.name].load_silhouette(recorded[frame.name].objects[1])
        hidden &= numbers == 1
        renderer.forward(frame.camera, near=0.05)
        covered.append(1.0 - renderer.transmittance.to_numpy()[hidden])
    covered = np.concatenate(covered)
    assert len(covered) > 100  # the recording tests it
    # 85 %, and 74 % if training takes the pixels of the other object for empty space
    assert np.mean(covered > 0.5) > 0.8
