"""The simulated infrared pair: its dots beside a real D435's, and what they are worth on plain walls."""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from digs_warp.data.images import read_image
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.sim.camera.profiles import load_profile
from digs_warp.sim.camera.rig import StereoRig
from digs_warp.sim.render.raycast import RaycastRenderer
from digs_warp.sim.scene.environment import Environment, panorama_directions
from digs_warp.sim.scene.scene import Material, Scene
from digs_warp.sim.sensor.color import PIXEL_EFFECTS
from digs_warp.sim.sensor.color.recorded import recorded_images
from digs_warp.sim.sensor.facts import measure_facts
from digs_warp.sim.sensor.frame import FrameTruth, Motion
from digs_warp.sim.sensor.infrared.pair import (
    in_three_channels,
    infrared_image,
    one_channel,
    stands_out,
    with_dots,
)
from digs_warp.sim.sensor.matcher import match
from digs_warp.sim.sensor.tiers import sense
from digs_warp.study.dots import WRONG, PlaneFit, fit_plane, measure_dots
from digs_warp.study.results import Result
from digs_warp.study.scenes import sample_data

REAL_PAIR = Path("rgbd/realsense_d435_ir_pair")
DISPARITIES = 128  # that the matcher searches

# The front of a gray box in the real pair: the only plain surface there that is neither saturated nor carpet.
BOX = np.array(((190, 285), (400, 232), (432, 215), (440, 232), (250, 330), (200, 310)), np.int32)

# Share of the light that the box reflects: with it, the dots of the profile are as bright as the real ones.
BOX_REFLECTANCE = 0.34

# Radiance in front of the simulated box, over that behind it: its side in the picture is dark.
DIM = 0.08

# Walls: their distances [m], and how much brighter than a room their surroundings are.
DISTANCES = (0.5, 1.0, 2.0, 4.0)
LIGHTS = (1, 10, 100)
ROOM = 0.7  # mean radiance of the built-in room and of most panoramas
WALL_REFLECTANCE = 0.8
WALL_WIDTH = 424  # of the images [px]


def bench_infrared(data: Path | None = None) -> list[Result]:
    """Return the statistics of real and simulated dots on one surface, and the depth of plain walls.

    Args:
        data: folder of the sample data; None: DIGS_WARP_SAMPLE_DATA or ../shared/data. Without the real pair
            there are only walls.
    """
    pair = (data or sample_data()) / REAL_PAIR
    compared = list(compare_with_real(pair)) if (pair / "calib.json").is_file() else []
    return [*compared, *_walls()]


def compare_with_real(folder: Path) -> Iterator[Result]:
    """Yield a row for the real pair and one for a simulated pair before the same plane."""
    left, right = (read_image(folder / f"{side}.png")[..., 0] for side in ("left", "right"))
    region = _box(left.shape)
    real, row = _row("real D435", left, right, region)
    yield row
    rig = _real_rig(folder)
    truth = _photograph(_box_scene(real, rig), rig, _dim_light(real, rig))
    yield _row("simulated", *_recorded(truth, seed=0), region)[1]


def _row(
    name: str, left: np.ndarray, right: np.ndarray, region: np.ndarray
) -> tuple[PlaneFit, Result]:
    dots = measure_dots(left, region)
    fit = fit_plane(match(left, right, DISPARITIES), region)
    values = {
        "px per dot": dots.area,
        "nearest dot / spacing": dots.nearest,
        "spot sigma [px]": dots.sigma,
        "brightness of a dot": dots.brightness,
        "spread of its logarithm": dots.spread,
        "image noise [DN]": dots.noise,
        "fill": fit.fill,
        "RMS to the plane [px]": fit.rms,
        "correlation at 2 px": fit.correlation[0],
        "at 8 px": fit.correlation[1],
    }
    return fit, Result({"pair": name}, values, "dots")


def _box(shape: tuple[int, ...]) -> np.ndarray:
    import cv2

    return cv2.fillPoly(np.zeros(shape[:2], np.uint8), [BOX], 1).astype(bool)


def _real_rig(folder: Path) -> StereoRig:
    """Return the profile's rig with the calibration of the real pair."""
    calibration = json.loads((folder / "calib.json").read_text())
    focal, center = calibration["fx_px"], (calibration["cx_px"], calibration["cy_px"])
    k = Intrinsics(calibration["width"], calibration["height"], focal, focal, *center)
    return replace(load_profile("d435").rig(), intrinsics=k, baseline=calibration["baseline_m"])


def _box_normal(fit: PlaneFit, rig: StereoRig) -> tuple[np.ndarray, float]:
    """Return unit normal and distance [m] of the plane in the camera: normal @ point = distance.

    Disparity f b / Z is linear in the pixels u = f X / Z + cx: f b = d0 Z + du f X + dv f Y.
    """
    k, (start, along, down) = rig.intrinsics, fit.plane
    middle = start + along * (k.cx - 0.5) + down * (k.cy - 0.5)
    direction = np.array([along * k.fx, down * k.fy, middle])
    length = float(np.linalg.norm(direction))
    return direction / length, rig.focal_baseline / length


def _box_scene(fit: PlaneFit, rig: StereoRig) -> Scene:
    normal, distance = _box_normal(fit, rig)
    across = np.cross(normal, [0.0, 1.0, 0.0])
    across /= np.linalg.norm(across)
    return _plate(distance * normal, across, np.cross(normal, across), BOX_REFLECTANCE)


def _dim_light(fit: PlaneFit, rig: StereoRig) -> Environment:
    """Return light that comes mostly from behind the plane."""
    normal, _ = _box_normal(fit, rig)
    behind = panorama_directions(64, 32) @ normal > 0
    radiance = np.where(behind, 1.0, DIM)[..., None] * np.ones(3)
    return Environment(radiance.astype(np.float32), 30.0)


def _walls() -> Iterator[Result]:
    """Yield what share of a plain wall gets depth, with the projector and without."""
    rig = load_profile("d435").rig(WALL_WIDTH)
    for distance in DISTANCES:
        values = {"disparity [px]": rig.focal_baseline / distance}
        for light in LIGHTS:
            environment = Environment(np.full((16, 32, 3), light * ROOM, np.float32), 30.0)
            truth = _photograph(_wall(distance), rig, environment)
            values[f"dots show, light x {light}"] = measure_facts([truth], rig).dot_share
            values[f"fill, light x {light}"] = _fill(truth)
        dark = _photograph(_wall(distance), replace(rig, projector_power=0.0), environment)
        values["fill, no projector"] = _fill(dark)
        yield Result({"distance [m]": distance}, values, "walls")


def _wall(distance: float) -> Scene:
    size = 3 * distance
    right, up = np.array([size, 0, 0]), np.array([0, -size, 0])
    return _plate(np.array([0, 0, distance]), right, up, WALL_REFLECTANCE)


def _fill(truth: FrameTruth) -> float:
    """Return the share of right matches where both eyes see the wall."""
    left, right = map(in_three_channels, _recorded(truth, seed=1))
    disparity = sense(truth, "guided", recorded=(left, right)).disparity
    both = truth.disparity < np.arange(disparity.shape[1])
    return float(np.mean((np.abs(disparity - truth.disparity) <= WRONG)[both]))


def _recorded(truth: FrameTruth, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the gray images of the pair with image noise."""
    left, right = recorded_images(truth, PIXEL_EFFECTS, seed)
    return one_channel(left), one_channel(right)


def _photograph(scene: Scene, rig: StereoRig, environment: Environment) -> FrameTruth:
    """Return what a pair at the origin that looks along z sees, with dots."""
    renderer = RaycastRenderer(scene, environment)
    camera = Camera(rig.intrinsics, np.eye(4))
    projector = camera.shifted_right(rig.projector_offset).world_from_cam
    gain = np.float32(rig.projector_power * renderer.exposure)
    eyes = camera, camera.shifted_right(rig.baseline)
    views = [renderer.render(eye) for eye in eyes]
    dots = [renderer.project_dots(eye, projector) for eye in eyes]
    plain = [infrared_image(view.image) for view in views]
    left, right = (with_dots(p, gain * d.light) for p, d in zip(plain, dots, strict=True))
    return FrameTruth(
        number=0,
        camera=camera,
        rig=rig,
        image=left,
        right=right,
        depth=views[0].depth,
        normals_world=views[0].normals_world,
        material_ids=views[0].material_ids,
        materials=scene.materials,
        motion=Motion((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        rays=renderer.frame_rays(camera, rig.baseline),
        dots_show=stands_out(plain[0], gain * dots[0].peak, rig),
    )


def _plate(center: np.ndarray, right: np.ndarray, up: np.ndarray, reflectance: float) -> Scene:
    """Return a matte parallelogram, ``center`` +- ``right`` +- ``up``, without texture."""
    corners = [center - right - up, center + right - up, center + right + up, center - right + up]
    normal = np.cross(right, up) / np.linalg.norm(np.cross(right, up))
    return Scene(
        vertices=np.array(corners, np.float32),
        faces=np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        face_materials=np.zeros(2, np.int32),
        normals=np.tile(normal, (4, 1)).astype(np.float32),
        uvs=np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32),
        vertex_colors=np.ones((4, 3), np.float32),
        materials=(Material("matte", np.full(3, reflectance), roughness=1.0),),
    )
