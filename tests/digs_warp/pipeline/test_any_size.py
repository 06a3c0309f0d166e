"""A reconstruction does not depend on the size of the world: no length in it is absolute."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.pipeline.mesh import extract_mesh
from digs_warp.pipeline.reconstruct import ReconstructConfig, reconstruct
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.train.config import Density, Stop, TrainConfig
from reference.larger_world import larger
from reference.tiny_capture import RADIUS, write_tiny_capture


def trained(folder: Path, factor: float) -> Reconstruction:
    capture = write_tiny_capture(folder / "capture", frames=12)
    frames = tuple(larger(frame, factor) for frame in capture.frames)
    config = ReconstructConfig(
        train=TrainConfig(stop=Stop(iterations=80), density=Density(strategy="adaptive"))
    )
    return reconstruct(replace(capture, frames=frames), config, folder / "result")


@pytest.fixture(scope="module")
def usual(tmp_path_factory: pytest.TempPathFactory) -> Reconstruction:
    return trained(tmp_path_factory.mktemp("usual"), 1.0)


@pytest.mark.parametrize("factor", [0.05, 20.0])
def test_a_world_of_another_size_becomes_the_same_splats(
    usual: Reconstruction, tmp_path: Path, factor: float
) -> None:
    other = trained(tmp_path, factor)
    assert len(other.gaussians) == pytest.approx(len(usual.gaussians), rel=0.05)
    assert other.scores.mean.psnr_frame == pytest.approx(usual.scores.mean.psnr_frame, abs=0.3)
    sizes = [np.median(result.gaussians.scales) for result in (other, usual)]
    assert sizes[0] == pytest.approx(factor * sizes[1], rel=0.05)
    radii = [
        np.median(
            np.linalg.norm(extract_mesh(result.gaussians, result.poses).mesh.points_world, axis=1)
        )
        for result in (other, usual)
    ]
    assert radii[0] == pytest.approx(factor * radii[1], rel=0.01)
    # The photographs show splats on the sphere, 12 mm wide, which reach a little farther.
    assert radii[1] == pytest.approx(RADIUS + 0.012, rel=0.1)
