"""Where a glTF material lays its maps: which texture coordinates, moved and turned how."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from digs_warp.sim.scene.mesh.gltf_numbers import GltfNumbers


@dataclass(frozen=True)
class MapPlace:
    """Where one map of a material lies.

    Attributes:
        uv_set: number of the set of texture coordinates.
        offset, rotation, scale: of KHR_texture_transform; the rotation in radians.
    """

    uv_set: int = 0
    offset: tuple[float, float] = (0.0, 0.0)
    rotation: float = 0.0
    scale: tuple[float, float] = (1.0, 1.0)

    @property
    def moves(self) -> bool:
        """Whether it changes the coordinates."""
        return (self.offset, self.rotation, self.scale) != ((0.0, 0.0), 0.0, (1.0, 1.0))


def map_places(material: dict[str, Any]) -> list[MapPlace]:
    """Return where the maps of a material lie, each place once, that of its base color first."""
    return list(dict.fromkeys(_place(entry) for entry in _map_entries(material)))


def placed_uvs(
    header: dict[str, Any], primitive: dict[str, Any], numbers: GltfNumbers
) -> np.ndarray | None:
    """Return the texture coordinates with which a primitive shows its first map, shape (n, 2), float32.

    None: they are those of the first set. A renderer that has one set of coordinates lays all maps there.
    """
    if "material" not in primitive:
        return None
    place = next(iter(map_places(header["materials"][primitive["material"]])), MapPlace())
    name = f"TEXCOORD_{place.uv_set}"
    if name not in primitive["attributes"] or not (place.moves or place.uv_set):
        return None
    uvs = numbers.values(primitive["attributes"][name]).astype(np.float64)
    return _moved(uvs, place).astype(np.float32)


def _moved(uvs: np.ndarray, place: MapPlace) -> np.ndarray:
    """Scale, turn and shift coordinates whose v points down, counterclockwise as the image is seen."""
    cos, sin = np.cos(place.rotation), np.sin(place.rotation)
    turn = np.array([[cos, sin], [-sin, cos]])
    return (uvs * place.scale) @ turn.T + place.offset


def _map_entries(material: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield the entries of the maps that the renderer draws."""
    pbr = material.get("pbrMetallicRoughness", {})
    extensions = material.get("extensions", {})
    glossy = extensions.get("KHR_materials_pbrSpecularGlossiness", {})
    entries = [
        pbr.get("baseColorTexture"),
        glossy.get("diffuseTexture"),
        pbr.get("metallicRoughnessTexture"),
        material.get("normalTexture"),
        material.get("emissiveTexture"),
        extensions.get("KHR_materials_transmission", {}).get("transmissionTexture"),
    ]
    yield from (entry for entry in entries if entry)


def _place(entry: dict[str, Any]) -> MapPlace:
    transform = entry.get("extensions", {}).get("KHR_texture_transform", {})
    u, v = transform.get("offset", (0.0, 0.0))
    width, height = transform.get("scale", (1.0, 1.0))
    return MapPlace(
        uv_set=int(transform.get("texCoord", entry.get("texCoord", 0))),
        offset=(float(u), float(v)),
        rotation=float(transform.get("rotation", 0.0)),
        scale=(float(width), float(height)),
    )
