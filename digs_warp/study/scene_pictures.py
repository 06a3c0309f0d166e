"""Eight scenes that stand on something: pictures, instance masks, and how far away their surfaces are."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.data.capture import Capture
from digs_warp.data.images import encode_jpeg, read_image
from digs_warp.data.layers import Layer
from digs_warp.record.files import write_atomically
from digs_warp.show.report.pictures import ColorScale
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.record import simulate_in_memory

WIDTH, HEIGHT, FRAMES = 640, 360, 3

# Meshes and environment of each scene, and settings that differ from the defaults.
SCENES: Mapping[str, tuple[tuple[str, ...], str, Mapping[str, Any]]] = {
    "helmet": (("flight_helmet",), "studio_small_03", {"object_size": 0.45}),
    "mustard": (("ycb_mustard_bottle",), "potsdamer_platz", {}),
    "stool": (("painted_stool",), "empty_warehouse_01", {}),
    "armchair": (("armchair",), "st_fagans_interior", {"object_size": 0.9}),
    "breakfast": (
        ("ycb_cracker_box", "tea_set", "ycb_mustard_bottle"),
        "st_fagans_interior",
        {},
    ),
    "yard": (("painted_stool", "boot_plain", "flight_helmet"), "forest_slope", {}),
    "shelf": (("wooden_bookshelf", "painted_stool"), "empty_warehouse_01", {}),
    "night": (
        ("boot_plain", "water_bottle_clear", "ycb_cracker_box", "sword_plain"),
        "dikhololo_night",
        {},
    ),
}

# Real recordings of a room and of one thing in a room: depth images and their units per metre.
REAL = {
    "hololens_room_sequence": ("depth/*.png", 1000.0),
    "tum_cabinet_orbit": ("depth/*.png", 5000.0),
}

# Colors of the objects in the pictures, RGB; the surround is left dark.
COLORS = np.array(
    [(0, 0, 0), (230, 120, 30), (70, 170, 230), (90, 190, 90), (200, 90, 190)], np.uint8
)


@dataclass(frozen=True)
class DepthSpread:
    """How far away the surfaces of a recording are.

    Attributes:
        median: [m].
        spread: ratio of the 95th to the 5th percentile.
        within: mean over the frames of the same ratio.
    """

    median: float
    spread: float
    within: float

    @staticmethod
    def of(depths: Sequence[np.ndarray]) -> "DepthSpread":
        """Measure depth images [m]; what is not positive and finite does not count."""
        known = [depth[np.isfinite(depth) & (depth > 0)] for depth in depths]
        low, median, high = np.percentile(np.concatenate(known), (5, 50, 95))
        per_frame = [np.percentile(k, (5, 95)) for k in known]
        within = np.mean([far / near for near, far in per_frame])
        return DepthSpread(float(median), float(high / low), float(within))


def record(name: str, data: Path) -> Capture:
    """Record one of `SCENES` without errors of the sensor.

    Args:
        name: of the scene.
        data: folder of the sample data.
    """
    names, surround, settings = SCENES[name]
    meshes: tuple[Path, ...] = tuple(data / "meshes" / mesh / f"{mesh}.glb" for mesh in names)
    config = SimulateConfig(
        environment=data / "envs" / surround / f"{surround}_1k.hdr",
        width=WIDTH,
        height=HEIGHT,
        frames=FRAMES,
        tier="truth",
        **settings,
    )
    if len(meshes) > 1:
        return simulate_in_memory(replace(config, scene=meshes))
    return simulate_in_memory(replace(config, mesh=next(iter(meshes))))


def real_spread(data: Path, name: str) -> DepthSpread:
    """Return the spread of one of `REAL`."""
    pattern, units = REAL[name]
    paths = sorted((data / "rgbd" / name).glob(pattern))
    return DepthSpread.of([read_image(path)[..., 0] / units for path in paths])


def picture(capture: Capture) -> np.ndarray:
    """Return two photographs, and depth and objects of the second, side by side: (height, width, 3)."""
    first, second = capture.frames[0], capture.frames[len(capture) // 2]
    depth = second.load_depth_true()
    near, far = np.nanpercentile(depth, (1, 99))
    scale = ColorScale("depth [m]", float(near), float(far), "viridis")
    several = second.has(Layer.INSTANCES)
    numbers = second.load_instances() if several else second.load_mask() // 255
    objects = COLORS[numbers.clip(0, len(COLORS) - 1)]
    return np.hstack([first.load_image(), second.load_image(), scale.paint(depth), objects])[
        ::2, ::2
    ]


def draw_scenes(data: Path, folder: Path) -> dict[str, DepthSpread]:
    """Write a picture of every scene, NAME.jpg; return the spread of its depth."""
    spreads = {}
    for name in SCENES:
        capture = record(name, data)
        write_atomically(folder / f"{name}.jpg", encode_jpeg(picture(capture)))
        spreads[name] = DepthSpread.of([frame.load_depth_true() for frame in capture.frames])
    return spreads
