"""What the tests of USD files share: the asset's frame, arrays of a field."""

import numpy as np

from digs_warp.geometry.rigid import matrix_from_quat_xyzw

# Y-up from z-up, written out by hand: x stays, up is y, what came towards the viewer goes to -z.
Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


def covariances(quats: np.ndarray, scales: np.ndarray) -> np.ndarray:
    """R S^2 R^T of each splat, (n, 3, 3), float64; quaternions xyzw."""
    half = matrix_from_quat_xyzw(quats) * scales[:, None, :].astype(np.float64)
    return half @ half.transpose(0, 2, 1)


SH = "radiance:sphericalHarmonicsCoefficients"
# The arrays of a field with the types of their values, halved with h for f.
KINDS: dict[str, str] = dict.fromkeys(("positions", "scales", SH, "extent"), "Vec3fArray")
KINDS |= {"orientations": "QuatfArray", "opacities": "FloatArray"}


def arrays_of(prim) -> dict[str, np.ndarray]:
    """The arrays of a field, as NumPy."""
    return {name: np.array(prim.GetAttribute(name).Get()) for name in KINDS}


def set_arrays(prim, arrays: dict[str, np.ndarray], half: tuple[str, ...] = ()) -> None:
    """Author arrays; those named in ``half`` under their half-precision names."""
    from pxr import Vt

    for name, values in arrays.items():
        is_half = name in half
        kind = getattr(Vt, KINDS[name].replace("fArray", "hArray") if is_half else KINDS[name])
        stored = kind.FromNumpy(np.ascontiguousarray(values, np.float16 if is_half else np.float32))
        prim.GetAttribute(name + "h" * is_half).Set(stored)
