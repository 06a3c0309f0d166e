"""Pictures of docs/simulate.md: eight scenes that stand on something, with depth and instance masks."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.data.capture import Capture
from digs_warp.data.images import encode_jpeg
from digs_warp.data.layers import Layer
from digs_warp.record.files import write_atomically
from digs_warp.show.report.pictures import ColorScale
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.record import simulate_in_memory
from digs_warp.study.scenes import sample_data
from scripts.page_marks import DOCS, fill

PICTURES = "images/scenes"
WIDTH, HEIGHT, FRAMES = 640, 360, 3

# Meshes and environment of each scene, and settings that differ from the defaults.
SCENES: Mapping[str, tuple[tuple[str, ...], str, Mapping[str, Any]]] = {
    "helmet": (("flight_helmet",), "studio_small_03", {"object_size": 0.45}),
    "mustard": (("ycb_mustard_bottle",), "potsdamer_platz", {}),
    "stool": (("painted_stool",), "empty_warehouse_01", {}),
    "armchair": (("armchair",), "st_fagans_interior", {"object_size": 0.9}),
    "breakfast": (("ycb_cracker_box", "tea_set", "ycb_mustard_bottle"), "st_fagans_interior", {}),
    "yard": (("painted_stool", "boot_plain", "flight_helmet"), "forest_slope", {}),
    "shelf": (("wooden_bookshelf", "painted_stool"), "empty_warehouse_01", {}),
    "night": (
        ("boot_plain", "water_bottle_clear", "ycb_cracker_box", "sword_plain"),
        "dikhololo_night",
        {},
    ),
}

# Colors of the objects in the pictures, RGB; the surround is left dark.
COLORS = np.array(
    [(0, 0, 0), (230, 120, 30), (70, 170, 230), (90, 190, 90), (200, 90, 190)], np.uint8
)


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


def main() -> None:
    """Write a picture of every scene, and show them on the page; needs the sample data."""
    shown = []
    for name, (meshes, surround, _) in SCENES.items():
        capture = record(name, sample_data())
        write_atomically(DOCS / PICTURES / f"{name}.jpg", encode_jpeg(picture(capture)))
        shown.append(f"{', '.join(meshes)} in {surround}\n\n![{name}]({PICTURES}/{name}.jpg)")
    fill("simulate.md", "pictures", "\n\n".join(shown))
