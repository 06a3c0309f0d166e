"""Draw the Gaussians of a USD scene with Mitsuba 3, from its own cameras; needs nothing of this package.

    python -m venv /tmp/mitsuba && /tmp/mitsuba/bin/pip install mitsuba==3.8.0 usd-core
    cd scripts/peers
    /tmp/mitsuba/bin/python mitsuba_draw.py scene.usdz /Asset/Rig/left 0 8 --size 640 360 --out pictures

A newer Mitsuba needs LLVM 16 or later (`apt-get install libllvm19`).

The attributes are read with OpenUSD, as the schema of ParticleField3DGaussianSplat says, and handed to
Mitsuba's ``ellipsoids`` and ``volprim_rf_basic``: rays through Gaussians in 3D, in their order along each
ray. That is another method than a rasterizer's, which projects each Gaussian and sorts by depth.
"""

import argparse
from pathlib import Path

import mitsuba  # pyright: ignore[reportMissingImports]
import numpy as np
from pxr import Gf, Usd, UsdGeom

# Splats along a ray, and rays per pixel.
DEPTH, RAYS = 512, 16
# Mitsuba's rays go on 1e-4 units behind a hit and pass over what begins in between: the scene is enlarged.
ENLARGED = 100.0


def field_of(stage: Usd.Stage) -> Usd.Prim:
    """Return the first visible field of splats."""
    for prim in stage.Traverse():
        if prim.GetTypeName() == "ParticleField3DGaussianSplat":
            return prim
    raise SystemExit("the scene has no ParticleField3DGaussianSplat")


def values(prim: Usd.Prim, name: str, time: float) -> np.ndarray:
    """Return an attribute in float, or its half-float twin (with an ``h`` at the end)."""
    for attribute in (prim.GetAttribute(name), prim.GetAttribute(name + "h")):
        found = attribute.Get(time) if attribute else None
        if found:
            return np.array(found, np.float32)
    raise SystemExit(f"{prim.GetPath()} has no {name}")


def ellipsoids(prim: Usd.Prim, time: float) -> dict[str, object]:
    """Return Mitsuba's shape of a field of splats; quaternions are (x, y, z, w)."""
    moved = UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(time)
    if not Gf.IsClose(moved, Gf.Matrix4d(1.0), 1e-9):
        raise SystemExit(f"{prim.GetPath()} is under a transform: bake it into the splats first")
    centers = values(prim, "positions", time)
    count = len(centers)
    quats = [[*q.GetImaginary(), q.GetReal()] for q in _quats(prim, time)]
    colors = values(prim, "radiance:sphericalHarmonicsCoefficients", time).reshape(count, -1)

    def tensor(array: object) -> mitsuba.TensorXf:
        return mitsuba.TensorXf(np.ascontiguousarray(array, np.float32).reshape(count, -1))

    return {
        "type": "ellipsoids",
        "centers": tensor(ENLARGED * centers),
        "scales": tensor(ENLARGED * values(prim, "scales", time)),
        "quaternions": tensor(quats),
        "opacities": tensor(values(prim, "opacities", time)),
        "sh_coeffs": tensor(colors),
    }


def _quats(prim: Usd.Prim, time: float) -> list[Gf.Quatf]:
    return list(
        prim.GetAttribute("orientations").Get(time) or prim.GetAttribute("orientationsh").Get(time)
    )


def sensor(prim: Usd.Prim, time: float, width: int, height: int) -> dict[str, object]:
    """Return Mitsuba's camera of a USD camera: it looks along +z with x to the left."""
    camera = UsdGeom.Camera(prim).GetCamera(time)
    pose = np.array(camera.transform).T @ np.diag([-1.0, 1.0, -1.0, 1.0])
    pose[:3, 3] *= ENLARGED
    aperture = camera.horizontalAperture, camera.verticalAperture
    offset = camera.horizontalApertureOffset, camera.verticalApertureOffset
    return {
        "type": "perspective",
        "fov": float(2 * np.degrees(np.arctan(aperture[0] / 2 / camera.focalLength))),
        "fov_axis": "x",
        "principal_point_offset_x": float(-offset[0] / aperture[0]),
        "principal_point_offset_y": float(offset[1] / aperture[1]),
        "near_clip": 1e-3,
        "to_world": mitsuba.ScalarTransform4f(pose),
        "film": {
            "type": "hdrfilm",
            "width": width,
            "height": height,
            "pixel_format": "rgb",
            "rfilter": {"type": "box"},
        },
        "sampler": {"type": "stratified", "sample_count": RAYS},
    }


def main() -> None:
    """Draw the views; each becomes TIME.npy, display colors on black, (height, width, 3), float32."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene")
    parser.add_argument("camera", help="path of a camera prim")
    parser.add_argument("times", type=float, nargs="+", help="time codes")
    parser.add_argument("--size", type=int, nargs=2, required=True, help="width and height [px]")
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    mitsuba.set_variant("llvm_ad_rgb")
    stage = Usd.Stage.Open(arguments.scene)
    arguments.out.mkdir(parents=True, exist_ok=True)
    scene = mitsuba.load_dict(
        {
            "type": "scene",
            "splats": ellipsoids(field_of(stage), 0.0),
            "integrator": {
                "type": "volprim_rf_basic",
                "max_depth": DEPTH,
                "srgb_primitives": False,
            },
        }
    )
    for time in arguments.times:
        camera = sensor(stage.GetPrimAtPath(arguments.camera), time, *arguments.size)
        picture = mitsuba.render(scene, sensor=mitsuba.load_dict(camera))
        np.save(arguments.out / f"{time:g}.npy", np.array(picture, np.float32))


if __name__ == "__main__":
    main()
