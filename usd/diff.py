"""How the Gaussians of two USD scenes differ, splat by splat if they have the same number of splats."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.data.gaussians import Gaussians
from digs_warp.geometry.rigid import matrix_from_quat_xyzw
from digs_warp.usd.reader import UsdScene, read_scene


@dataclass(frozen=True)
class Difference:
    """One thing that differs.

    Attributes:
        what: such as "positions" or "metadata settings.iterations".
        first, second: its values as text; for arrays of splats, empty.
        largest: the largest difference of arrays; None for single values.
        unit: of ``largest``.
    """

    what: str
    first: str = ""
    second: str = ""
    largest: float | None = None
    unit: str = ""

    def __str__(self) -> str:
        if self.largest is None:
            return f"{self.what}: {self.first} | {self.second}"
        return f"{self.what}: up to {self.largest:.3g} {self.unit}".rstrip()


def differences(first: Path, second: Path, prim_path: str | None = None) -> list[Difference]:
    """Return how Gaussians and metadata of two scenes differ in our world; empty if they are the same.

    Splats are compared in the order of the files; rotations as turns, so that a quaternion and its
    negative are the same.

    Raises:
        UsdError: a scene cannot be read.
    """
    one, other = read_scene(first, prim_path), read_scene(second, prim_path)
    return [*_of_splats(one.gaussians, other.gaussians), *_of_metadata(one, other)]


def _of_splats(one: Gaussians, other: Gaussians) -> list[Difference]:
    if len(one) != len(other):
        found = [Difference("splats", f"{len(one):,}", f"{len(other):,}")]
        if len(one) and len(other):
            middles = _words(one.means.mean(axis=0)), _words(other.means.mean(axis=0))
            found.append(Difference("middle [m]", middles[0], middles[1]))
        return found
    found = []
    if one.sh_degree != other.sh_degree:
        found.append(Difference("sh degree", str(one.sh_degree), str(other.sh_degree)))
    if len(one) == 0:
        return found
    shared = min(one.sh.shape[1], other.sh.shape[1])
    compared = {
        "positions": (_largest(one.means, other.means), "m"),
        "log scales": (_largest(one.log_scales, other.log_scales), ""),
        "rotations": (_largest_turn(one.quats, other.quats), "degrees"),
        "opacities": (_largest(one.opacities, other.opacities), ""),
        "sh": (_largest(one.sh[:, :shared], other.sh[:, :shared]), ""),
    }
    found += [
        Difference(what, largest=value, unit=unit)
        for what, (value, unit) in compared.items()
        if value > 0
    ]
    return found


def _largest(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.abs(one.astype(np.float64) - other).max())


def _largest_turn(one: np.ndarray, other: np.ndarray) -> float:
    """Return the largest angle between two rotations [degrees]."""
    if np.array_equal(one, other):
        return 0.0
    apart = matrix_from_quat_xyzw(one) - matrix_from_quat_xyzw(other)
    # Two rotations an angle t apart differ by 2 sqrt(2) sin(t / 2) in the Frobenius norm.
    norm = np.sqrt(np.einsum("nij,nij->n", apart, apart)).max()
    return float(np.rad2deg(2 * np.arcsin(min(1.0, norm / np.sqrt(8)))))


def _of_metadata(one: UsdScene, other: UsdScene) -> list[Difference]:
    before, after = _flat(one.metadata), _flat(other.metadata)
    return [
        Difference(f"metadata {key}", str(before.get(key, "-")), str(after.get(key, "-")))
        for key in dict.fromkeys([*before, *after])
        if before.get(key) != after.get(key)
    ]


def _flat(value: Any, name: str = "") -> dict[str, Any]:
    if not isinstance(value, dict):
        return {name: value}
    return {
        key: item
        for part, inner in value.items()
        for key, item in _flat(inner, f"{name}.{part}" if name else str(part)).items()
    }


def _words(vector: np.ndarray) -> str:
    return " ".join(f"{value:.4f}" for value in vector)
