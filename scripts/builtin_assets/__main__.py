"""Write the built-in object and room into sim/scene/assets: about 0.9 MB in all.

    cd scripts && python -m builtin_assets

Positions are kept to 15 um, normals to a thousandth, textures and panorama as WebP. The panorama is sRGB
times a gain, which is above 1 on lamps alone.
"""

import sys

import cv2
import numpy as np

from builtin_assets.room import room_radiance
from builtin_assets.textures import textures
from builtin_assets.vase import NECK, vase_patches
from digs_warp.data.images import srgb_from_linear
from digs_warp.sim.scene.builtin import (
    ASSETS,
    GAIN_STEPS,
    NORMAL_STEPS,
    POSITION_STEPS,
    SEAM,
    UV_STEPS,
    WHITE,
)
from digs_warp.sim.scene.shapes import join_patches

QUALITY = 78  # of WebP, 0 to 100

# Textures whose texels are finer than the pixels of any recording: half their size is kept.
HALVED = ("cord", "cane")


def main() -> None:
    """Write all assets."""
    ASSETS.mkdir(exist_ok=True)
    _write_vase()
    _write_room()
    sys.stdout.write(f"{ASSETS}: {sum(p.stat().st_size for p in ASSETS.iterdir()) / 1e6:.2f} MB\n")


def _write_vase() -> None:
    patches = vase_patches()
    whole = join_patches(patches)
    low, high = whole.vertices.min(axis=0), whole.vertices.max(axis=0)
    positions = (whole.vertices - (low + high) / 2) / (high - low).max()
    np.savez_compressed(
        ASSETS / "vase.npz",
        vertices=_deltas(positions * POSITION_STEPS),
        normals=_deltas(whole.normals * NORMAL_STEPS),
        uvs=_deltas(whole.uvs * UV_STEPS),
        faces=_deltas(whole.faces),
        face_materials=np.repeat(range(len(patches)), [len(p.faces) for p in patches]).astype("u1"),
    )
    for name, texture in textures(patches[NECK]).items():
        size = np.array(texture.shape[1::-1]) // (2 if name in HALVED else 1)
        small = cv2.resize(texture, size.tolist(), interpolation=cv2.INTER_AREA)
        # Textures close round the object: repeated columns keep the seam out of the compression.
        _write(f"{name}.webp", np.pad(small, ((0, 0), (SEAM, SEAM), (0, 0)), "wrap"))


def _write_room() -> None:
    radiance = room_radiance()
    gain = np.rint(GAIN_STEPS * np.log2(np.maximum(radiance.max(axis=2) / WHITE, 1.0)))
    base = radiance / (WHITE * 2.0 ** (gain[..., None] / GAIN_STEPS))
    _write("room.webp", np.rint(255 * np.clip(srgb_from_linear(base), 0, 1)).astype(np.uint8))
    np.savez_compressed(ASSETS / "room.npz", gain=gain.astype(np.uint8))


def _deltas(values: np.ndarray) -> np.ndarray:
    """Return rounded values as differences along each column, which compress well, (columns, rows)."""
    whole = np.rint(values).astype(np.int32)
    return np.ascontiguousarray(np.diff(whole, axis=0, prepend=0).T)


def _write(name: str, rgb: np.ndarray) -> None:
    bgr = np.ascontiguousarray(rgb[..., ::-1])
    encoded = cv2.imencode(".webp", bgr, [cv2.IMWRITE_WEBP_QUALITY, QUALITY])[1]
    (ASSETS / name).write_bytes(encoded.tobytes())


if __name__ == "__main__":
    main()
