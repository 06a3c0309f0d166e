"""What masks from depth cost, on an object with a part of glass, through which depth shows what is behind."""

from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from PIL import Image
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial

import digs_warp as dw
from digs_warp.data.images import write_image
from reference.mesh_files import edit_gltf, save

# Wanted: that they cost no more [dB].
MOST = 2.0


def write_lamp(path: Path) -> Path:
    """A patterned foot with a globe of glass on it, 31 cm high."""
    colors = np.random.default_rng(0).uniform(60, 220, (16, 16, 3)).repeat(8, 0).repeat(8, 1)
    pattern = Image.fromarray(colors.astype(np.uint8))
    foot = trimesh.creation.cylinder(0.09, 0.2)
    foot.apply_translation([0, 0, 0.1])
    turn = np.arctan2(foot.vertices[:, 1], foot.vertices[:, 0]) / (2 * np.pi)
    paint = PBRMaterial(baseColorTexture=pattern, metallicFactor=0.0, roughnessFactor=0.8)
    uv = np.stack([turn, 4 * foot.vertices[:, 2]], axis=1)
    foot.visual = TextureVisuals(uv=uv, material=paint)
    globe = trimesh.creation.icosphere(subdivisions=3, radius=0.06)
    globe.apply_translation([0, 0, 0.25])
    clear = PBRMaterial(name="globe", metallicFactor=0.0, roughnessFactor=0.05)
    globe.visual = TextureVisuals(uv=np.zeros((len(globe.vertices), 2)), material=clear)
    lamp = trimesh.Scene([foot, globe])
    lamp.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, [1, 0, 0]))

    def make_glass(header: dict[str, Any]) -> None:
        name = "KHR_materials_transmission"
        for material in header["materials"]:
            if material.get("name") == "globe":
                material["extensions"] = {name: {"transmissionFactor": 0.9}}
        header.setdefault("extensionsUsed", []).append(name)

    return edit_gltf(save(path, lamp), make_glass)


def test_a_lamp_with_glass_loses_little_by_masks_from_depth(tmp_path: Path) -> None:
    far = np.random.default_rng(1).uniform(40, 230, (32, 64, 3)).repeat(8, 0).repeat(8, 1)
    write_image(tmp_path / "far.png", far.astype(np.uint8))
    settings = {"environment": tmp_path / "far.png", "width": 192, "camera_path": "arc", "seed": 1}
    lamp = write_lamp(tmp_path / "lamp.glb")
    capture = dw.simulate(lamp, profile="bare-matcher", frames=12, elevations=(25.0,), **settings)
    with_true, by_depth = (
        # Held-out views are compared inside the true masks.
        dw.reconstruct(capture, masks=masks, iterations=60, sh_degree=1, test_every=4).scores.mean
        for masks in ("capture", "depth")
    )
    assert by_depth.psnr_object > with_true.psnr_object - MOST
    assert by_depth.psnr_frame > with_true.psnr_frame - MOST  # no table around it
