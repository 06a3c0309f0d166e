"""The captured scene: one triangle mesh with materials, around the origin, z up, in metres."""

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from digs_warp.geometry.rigid import rotation_in_plane
from digs_warp.sim.scene.mesh.placement import Placement

# A surface that hides less than this share of the background counts as transparent.
OPAQUE_SHARE = 0.5

# Light that glass, plastic and paint reflect at normal incidence: that of refractive index 1.5.
DIELECTRIC_REFLECTANCE = 0.04


@dataclass(frozen=True, eq=False)
class Material:
    """How a surface looks; a subset of glTF's metallic-roughness model.

    Attributes:
        name: label for messages and reports.
        base_color: linear RGB factor in 0..1, shape (3,); multiplies the texture and vertex colors.
        texture: sRGB base-color image, shape (height, width, 3), uint8, row 0 on top; None: plain.
        roughness: perceptual roughness, 0 (mirror) to 1; the mean where it varies.
        metallic: 0 (dielectric) to 1 (metal); the mean where it varies.
        finish_texture: roughness and metallic of each texel, (height, width, 2), uint8, 255 = 1; None:
            the same everywhere.
        opacity: share of the background that the surface covers, 0 to 1 (glTF's alpha); the mean where it
            varies.
        opacity_texture: opacity of each texel, (height, width), uint8; None: the same everywhere.
        alpha_cutoff: where the opacity is lower, there is a hole.
        transmission: share of the light that goes straight on through the surface, a thin wall (glass),
            tinted with the base color, 0 to 1; the mean where it varies.
        transmission_texture: transmission of each texel, (height, width), uint8; None: as above.
        reflectance: of what is not metal, at normal incidence, 0 to 1.
        emission: linear RGB of the light that the surface emits; 1 is full white at any exposure.
        emission_texture: sRGB image that multiplies ``emission``, (height, width, 3), uint8; None: plain.
        normal_texture: tangent-space normals as glTF has them (x along u, y along v, z outward;
            128 = 0), (height, width, 3), uint8, already scaled; None: smooth.
    """

    name: str
    base_color: np.ndarray
    texture: np.ndarray | None = None
    roughness: float = 1.0
    metallic: float = 0.0
    finish_texture: np.ndarray | None = None
    opacity: float = 1.0
    opacity_texture: np.ndarray | None = None
    alpha_cutoff: float = 0.0
    transmission: float = 0.0
    transmission_texture: np.ndarray | None = None
    reflectance: float = DIELECTRIC_REFLECTANCE
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)
    emission_texture: np.ndarray | None = None
    normal_texture: np.ndarray | None = None

    @property
    def is_transparent(self) -> bool:
        """Whether the background shows more strongly than the surface itself."""
        return self.opacity * (1.0 - self.transmission) < OPAQUE_SHARE


# The number of whatever belongs to no object: a table top, the surround.
FURNITURE = 0

# Images of object numbers have eight bits.
MOST_OBJECTS = 255


@dataclass(frozen=True, eq=False)
class SceneObject:
    """One of the things that are recorded.

    Attributes:
        name: for people; not unique.
        mesh: its file; None: made by code.
        world_from_mesh: rotation, scale and translation from coordinates of the file to the world [m],
            shape (4, 4), float64; the identity if it was made by code.
        size: sides of its bounding box along x, y and z of the world [m], shape (3,), float64.
        placement: how the file was read; None: made by code, or placed as in an earlier recording.
    """

    name: str
    mesh: Path | None
    world_from_mesh: np.ndarray
    size: np.ndarray
    placement: Placement | None = None


@dataclass(frozen=True, eq=False)
class Scene:
    """A triangle soup in the world: z up, metres. A single object is centered on the origin.

    Attributes:
        vertices: positions [m], shape (n, 3), float32.
        faces: vertex indices, shape (m, 3), int32, no degenerate faces, m >= 1.
        face_materials: index into ``materials`` of each face, shape (m,), int32.
        normals: unit vertex normals, shape (n, 3), float32.
        uvs: texture coordinates, shape (n, 2), float32; v = 0 is the bottom row of the image, values
            outside 0..1 repeat.
        vertex_colors: linear RGB in 0..1, shape (n, 3), float32; 1 where the mesh has none.
        materials: at least one.
        face_objects: number of the object of each face, shape (m,), int32: `FURNITURE`, or 1 to n. Left
            out: 1 everywhere.
        objects: what the numbers from 1 stand for, in that order; empty where nobody asks.
    """

    vertices: np.ndarray
    faces: np.ndarray
    face_materials: np.ndarray
    normals: np.ndarray
    uvs: np.ndarray
    vertex_colors: np.ndarray
    materials: tuple[Material, ...]
    face_objects: np.ndarray = field(default_factory=lambda: np.empty(0, np.int32))
    objects: tuple[SceneObject, ...] = ()

    def __post_init__(self) -> None:
        if not len(self.face_objects):
            object.__setattr__(self, "face_objects", np.ones(len(self.faces), np.int32))

    @property
    def radius(self) -> float:
        """Radius of the smallest sphere around the origin that holds every vertex [m]."""
        return float(np.linalg.norm(self.vertices, axis=1).max())

    @property
    def object_radius(self) -> float:
        """The same without furniture [m]."""
        return float(np.linalg.norm(self.object_vertices, axis=1).max())

    @property
    def size(self) -> np.ndarray:
        """Sides of the bounding box of the objects along x, y and z [m], shape (3,), float64."""
        return np.ptp(self.object_vertices, axis=0).astype(np.float64)

    def turned(self, angle: float) -> "Scene":
        """Return the scene with its objects, not the furniture, turned counterclockwise from above [rad]."""
        turn = np.eye(4)
        turn[:2, :2] = rotation_in_plane(angle)
        owned = [self._used(self.face_objects == i + 1) for i in range(len(self.objects))]
        turning = self._used(self.face_objects != FURNITURE)
        vertices, normals = self.vertices.copy(), self.normals.copy()
        for each in (vertices, normals):
            each[turning] = each[turning].astype(np.float64) @ turn[:3, :3].T
        objects = tuple(
            replace(
                each,
                world_from_mesh=turn @ each.world_from_mesh,
                size=np.ptp(vertices[own], axis=0).astype(np.float64),
            )
            for each, own in zip(self.objects, owned, strict=True)
        )
        return replace(self, vertices=vertices, normals=normals, objects=objects)

    @property
    def has_furniture(self) -> bool:
        """Whether some faces belong to no object."""
        return bool((self.face_objects == FURNITURE).any())

    @property
    def object_vertices(self) -> np.ndarray:
        """The vertices of the objects' faces [m], shape (k, 3), float32."""
        if not self.has_furniture:
            return self.vertices
        return self.vertices[self._used(self.face_objects != FURNITURE)]

    def _used(self, faces: np.ndarray) -> np.ndarray:
        """Return which vertices some faces, (m,), bool, use, ascending."""
        return np.unique(self.faces[faces])
