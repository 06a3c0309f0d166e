"""Labels of recordings, and points followed from one eye into another, against matrices and brute force."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import map_coordinates
from scipy.spatial.transform import Rotation

from digs_warp.checks import CaptureError, DigsError
from digs_warp.data.capture import read_capture
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer, Occlusion
from digs_warp.geometry.camera import Camera, Intrinsics, pixel_centers
from digs_warp.geometry.rigid import look_at, rigid
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.frame_maker import FrameMaker
from digs_warp.sim.record.labels.names import LABELS
from digs_warp.sim.record.record import simulate
from digs_warp.sim.render.raycast import RaycastRenderer
from digs_warp.sim.render.views import CameraTrack, Followed
from digs_warp.sim.scene.environment import Environment
from digs_warp.sim.scene.join import join_scenes
from digs_warp.sim.scene.scene import Material, Scene
from reference.file_hashes import file_hashes
from reference.label_twin import landings, occlusion
from reference.plates import plate

# Frames a third of a second apart, for the flow; only three are made.
WALK = SimulateConfig(
    profile="bare-matcher",
    frames=270,
    width=96,
    samples_per_pixel=4,
    tier="guided",
    effects="none",
    labels="all",
    seed=3,
)
RECORDED = replace(WALK, frames=3, width=64, samples_per_pixel=1, effects="all")


@pytest.fixture(scope="module")
def maker() -> FrameMaker:
    return FrameMaker.of(WALK)


def frame_of(maker: FrameMaker, number: int) -> Frame:
    session = maker.session
    rendered = maker.render(number)
    images = maker.finish(rendered, {}).by_layer()
    return Frame(f"{number}", rendered.truth.camera, session.moment(number), images)


@pytest.fixture(scope="module")
def frame(maker: FrameMaker) -> Frame:
    return frame_of(maker, 5)


@pytest.fixture(scope="module")
def following(maker: FrameMaker) -> Frame:
    return frame_of(maker, 6)


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("labels") / "capture"
    simulate(RECORDED, folder)
    return folder


def at(image: np.ndarray, places: np.ndarray) -> np.ndarray:
    """An image between its pixel centers; ``places`` are columns and rows [px], (..., 2)."""
    rows, columns = places[..., 1] - 0.5, places[..., 0] - 0.5
    return map_coordinates(image.astype(np.float64), [rows, columns], order=1, mode="nearest")


def around(image: np.ndarray, places: np.ndarray) -> np.ndarray:
    """The four pixels around each place, (4, ...)."""
    corners = [np.floor(places - 0.5) + 0.5 + step for step in ([0, 0], [0, 1], [1, 0], [1, 1])]
    return np.array([at(image, corner) for corner in corners])


def smooth(image: np.ndarray, places: np.ndarray, step: float) -> np.ndarray:
    """Where an image does not jump between the four pixels around a place."""
    return np.ptp(around(image, places), axis=0) < step


def centers(image: np.ndarray) -> np.ndarray:
    return pixel_centers(image.shape[1], image.shape[0])


def test_flow_and_change_of_disparity_lead_to_the_next_frame(
    frame: Frame, following: Frame
) -> None:
    flow, change = frame.load(Layer.FLOW)[..., :2], frame.load(Layer.FLOW)[..., 2]
    places = centers(flow) + flow
    then, disparity = following.load(Layer.DISPARITY), frame.load(Layer.DISPARITY)
    seen = (frame.load(Layer.FLOW_OCCLUSION) == Occlusion.SEEN) & smooth(then, places, 0.5)
    assert seen.mean() > 0.6 and np.median(np.linalg.norm(flow, axis=-1)) > 1
    apart = np.abs(at(then, places) - disparity - change)[seen]
    assert np.quantile(apart, 0.99) < 0.05 and np.median(apart) < 2e-3
    assert np.abs(change[seen]).max() > 0.1


def test_disparity_is_what_a_drifted_pair_shows() -> None:
    """The label leads to the same point of the recorded images, which f b / Z does not."""
    drifting = FrameMaker.of(replace(WALK, effects="calibration-drift", strength=20.0))
    truth = drifting.render(5).truth
    k, right_k = truth.rig.intrinsics, truth.drift.right_intrinsics(truth.rig.intrinsics)
    disparity = frame_of(drifting, 5).load(Layer.DISPARITY)
    assert np.abs(disparity - truth.disparity).max() > 0.3
    # The point in the axes of the turned eye, by matrices.
    points = np.linalg.inv(k.matrix) @ np.concatenate(
        [centers(disparity).reshape(-1, 2).T, np.ones((1, disparity.size))]
    )
    points = points * truth.depth.reshape(-1) - np.array([[truth.rig.baseline], [0], [0]])
    turned = right_k.matrix @ truth.drift.believed_from_turned.T @ points
    column = (turned[0] / turned[2]).reshape(disparity.shape)
    np.testing.assert_allclose(disparity, centers(disparity)[..., 0] - column, atol=2e-4)


def test_the_right_mask_covers_the_object_in_the_right_eye(maker: FrameMaker, frame: Frame) -> None:
    mask = frame.load(Layer.MASK_RIGHT)
    ids = maker.session.eyes(5, maker._shutter(5))[1].geometry().object_ids
    assert (ids[mask == 255] == 1).all() and (ids[mask == 0] == 0).all()
    assert 0.05 < (mask == 255).mean() < 0.9


def test_frames_have_the_layers_that_were_asked_for(recording: Path) -> None:
    frames = read_capture(recording).frames
    every = {layer for layers in LABELS.values() for layer in layers}
    for frame in frames[:-1]:
        assert every <= set(frame.layers)
    assert every - set(frames[-1].layers) == set(LABELS["flow"])  # there is no next frame
    assert frames[0].load(Layer.FLOW)[..., :2].shape == (36, 64, 2)
    with pytest.raises(CaptureError, match="flow_file_path"):
        frames[-1].load(Layer.FLOW)
    with pytest.raises(DigsError, match="--labels: no label 'flows'; did you mean 'flow'"):
        SimulateConfig(labels="flows")


def test_labels_change_nothing_else(recording: Path, tmp_path: Path) -> None:
    simulate(replace(RECORDED, labels="none"), tmp_path / "plain")
    plain, labeled = file_hashes(tmp_path / "plain"), file_hashes(recording)
    for name in plain:
        if name.endswith((".png", ".exr")):
            assert plain[name] == labeled[name], name
    assert not read_capture(tmp_path / "plain").frames[0].has(Layer.NORMALS)


def test_an_infrared_pair_has_its_own_disparity_and_the_color_camera_the_flow() -> None:
    config = SimulateConfig(
        profile="d435", frames=270, width=64, samples_per_pixel=1, labels="all", effects="none"
    )
    maker = FrameMaker.of(config)
    frame, rig = frame_of(maker, 2), maker.session.rig
    truth = maker.render(2).truth
    np.testing.assert_allclose(
        frame.load(Layer.DISPARITY), rig.focal_baseline / truth.depth, rtol=1e-5
    )
    right = rig.focal_baseline / frame.load(Layer.DEPTH_RIGHT)
    np.testing.assert_allclose(frame.load(Layer.DISPARITY_RIGHT), right, rtol=1e-5)
    camera, later = (
        maker.session.image_eye(2, maker._shutter(2)),
        maker.session.image_eye(3, maker._shutter(3)),
    )
    (now,), (then,) = next(camera.middle_track.bands()), next(later.middle_track.bands())
    points = now.unproject(centers(frame.load_depth_true()), frame.load_depth_true())
    places, depth = then.project(points)
    np.testing.assert_allclose(frame.load(Layer.FLOW)[..., :2], places - centers(depth), atol=2e-3)
    change = now.intrinsics.fx * rig.baseline * (1 / depth - 1 / frame.load_depth_true())
    np.testing.assert_allclose(frame.load(Layer.FLOW)[..., 2], change, atol=1e-3)


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
