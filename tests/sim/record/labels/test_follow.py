"""Points followed from one eye into another, against matrices and brute force in float64."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from digs_warp.data.layers import Occlusion
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at, rigid
from digs_warp.sim.render.raycast import RaycastRenderer
from digs_warp.sim.render.views import CameraTrack, Followed
from digs_warp.sim.scene.environment import Environment
from digs_warp.sim.scene.join import join_scenes
from digs_warp.sim.scene.scene import Material, Scene
from reference.label_twin import landings, occlusion
from reference.plates import plate

K = Intrinsics.from_fov(64, 48, 60.0)
POSE = look_at(np.array([1.0, 0, 0]), np.zeros(3), np.array([0.0, 0.0, 1.0]))
SKY = Environment(np.ones((8, 16, 3), np.float32))
MATTE = Material("matte", np.full(3, 0.5, np.float32))
GLASS = replace(MATTE, name="glass", transmission=1.0, roughness=0.0)


def sheets(material: Material = MATTE) -> Scene:
    """Three tilted sheets in front of each other; the surround behind them."""
    return join_scenes(
        plate((0.3, 0.05, 0.02), (0.02, 0.12, 0.03), (0.05, 0.0, 0.1), material),
        plate((0.0, -0.15, 0.1), (-0.1, 0.2, 0.0), (0.0, 0.05, 0.15), MATTE),
        plate((-0.5, 0.1, -0.1), (0.2, 0.5, 0.0), (0.0, 0.1, 0.3), MATTE),
    )


def moved(pose: np.ndarray, turn: tuple[float, ...], way: tuple[float, ...]) -> np.ndarray:
    """The pose after a turn [rad] and a way [m] in its own axes."""
    return pose @ rigid(Rotation.from_rotvec(turn).as_matrix(), np.array(way))


def still(pose: np.ndarray, k: Intrinsics = K) -> CameraTrack:
    return CameraTrack.still(Camera(k, pose))


def rolling(pose: np.ndarray, bands: int = 6) -> CameraTrack:
    """A camera that turns and moves while its rows are read."""
    shares = np.arange(bands) / bands
    poses = [moved(pose, (0.02 * s, 0.06 * s, 0), (0.03 * s, 0.01 * s, 0.02 * s)) for s in shares]
    return CameraTrack(K, np.array(poses)[:, None])


LATER = moved(POSE, (0.03, -0.05, 0.02), (0.11, -0.03, 0.06))
PAIRS = {
    "stereo": (still(POSE), still(moved(POSE, (0, 0, 0), (0.12, 0, 0)))),
    "turned": (
        still(POSE),
        still(moved(POSE, (0.02, 0.03, 0.01), (0.12, 0, 0)), replace(K, fx=70.0, fy=71.0)),
    ),
    "next": (still(POSE), still(LATER)),
    "rolling": (rolling(POSE), rolling(LATER)),
}


def followed(scene: Scene, pair: tuple[CameraTrack, CameraTrack]) -> tuple[Followed, np.ndarray]:
    """Points of the first eye as the second sees them, and their depth in the first."""
    source, target = pair
    renderer = RaycastRenderer(scene, SKY)
    parts = [renderer.render_geometry(camera) for (camera,) in source.bands()]
    depth = np.concatenate([part.depth for part in parts])
    return renderer.follow(source, depth, target), depth


@pytest.mark.parametrize("name", PAIRS)
def test_points_land_where_matrices_say(name: str) -> None:
    found, depth = followed(sheets(), PAIRS[name])
    expected = landings(PAIRS[name][0], depth, PAIRS[name][1])
    known = np.isfinite(expected.depth)
    assert known.mean() > 0.9
    # Tighter than the 0.05 px that labels promise; depth is the same float32 in both.
    np.testing.assert_allclose(found.shift[known], expected.shift[known], atol=1e-4)
    np.testing.assert_allclose(found.depth[known], expected.depth[known], rtol=1e-6)
    assert np.abs(found.shift[known]).max() > 3  # there is something to get wrong


@pytest.mark.parametrize("name", PAIRS)
def test_occlusion_is_that_of_a_ray_to_every_point(name: str) -> None:
    scene = sheets()
    found, depth = followed(scene, PAIRS[name])
    landed = landings(PAIRS[name][0], depth, PAIRS[name][1])
    known = np.isfinite(landed.depth)
    expected = occlusion(landed, scene)
    for state in Occlusion:
        assert (expected == state)[known].mean() > 0.02
    # A ray that grazes an edge may fall to either side.
    assert (found.occlusion != expected)[known].mean() < 1e-3


def test_points_behind_the_other_eye_have_no_place() -> None:
    turned_around = still(moved(POSE, (0, np.pi, 0), (0, 0, 0)))
    found, _ = followed(sheets(), (still(POSE), turned_around))
    assert np.isnan(found.shift).all() and np.isnan(found.depth).all()
    assert (found.occlusion == Occlusion.OUTSIDE).all()


@pytest.mark.parametrize("material", [MATTE, GLASS])
def test_the_other_side_of_a_thin_sheet_is_hidden(material: Material) -> None:
    """From the front, then from behind: the same places, but another side."""
    scene = plate((0, 0, 0), (0, 0.3, 0), (0, 0, 0.2), material)
    back = look_at(np.array([-1.0, 0, 0]), np.zeros(3), np.array([0.0, 0.0, 1.0]))
    found, depth = followed(scene, (still(POSE), still(back)))
    on_sheet = depth < 1.1
    assert on_sheet.any() and (found.occlusion[on_sheet] == Occlusion.HIDDEN).all()
