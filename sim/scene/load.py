"""Any mesh file as a `Scene`: z up, in its real size, centered on the origin."""

import logging
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from digs_warp.geometry.rigid import transform_points
from digs_warp.sim.scene.mesh.normalize import box_of, drop_unused_vertices, in_world, used_vertices
from digs_warp.sim.scene.mesh.normals import fill_normals
from digs_warp.sim.scene.mesh.parts import Triangles
from digs_warp.sim.scene.mesh.placement import (
    Placement,
    Scale,
    guessed_scale,
    place,
    stated_scale,
)
from digs_warp.sim.scene.mesh.read import GLTF_SUFFIXES, UP_AXIS_BY_SUFFIX, read_triangles
from digs_warp.sim.scene.mesh.resting import SAME_POSE, resting_turn
from digs_warp.sim.scene.scene import Material, Scene, SceneObject

logger = logging.getLogger(__name__)

# Of what is taken as metres, more than this [m] is rare: a file in inches or centimetres looks so.
LARGE = 2.5


def load_scene(
    path: Path, size: float | None = None, up: str = "auto", unit: str = "auto"
) -> Scene:
    """Load a GLB, glTF, OBJ, PLY or STL file.

    A logged warning names parts that the renderer cannot show as intended, textures
    of OBJ and PLY files that cannot be used, and faces that are dropped because they have no area or are not
    finite. Vertex colors are linear in glTF, as its standard says, and sRGB in the other formats.

    Args:
        path: the file; its textures and buffers are read relative to its folder.
        size: longest edge of the bounding box in the world [m]; None: that of the file.
        up: axis of the file that points up: "x", "y", "z", or "auto" for the convention of the format; with
            "auto", an object that would fall is turned so that it rests.
        unit: of the file: "m", "cm", "mm", "in", or "auto": metres for glTF, else a guess by the size.

    Raises:
        MeshError: missing, empty, truncated, unsupported, or without a single usable triangle.
    """
    return read_mesh(path, size, up, unit).scene()


def read_mesh(
    path: Path, size: float | None = None, up: str = "auto", unit: str = "auto"
) -> "MeshFile":
    """Read a file that may still go somewhere else; see `load_scene`."""
    path = Path(path)
    triangles, materials = read_triangles(path)
    placement = _placement(path, triangles, size, up, unit)
    return MeshFile(path, triangles, materials, placement)


@dataclass(frozen=True, eq=False)
class MeshFile:
    """The content of a mesh file, and where it would stand alone.

    Attributes:
        path: the file.
        triangles: in its frame.
        materials: of the triangles.
        placement: at rest, its box centered on the origin.
    """

    path: Path
    triangles: Triangles
    materials: tuple[Material, ...]
    placement: Placement

    @cached_property
    def vertices(self) -> np.ndarray:
        """The vertices that its faces use, where the object would stand alone [m], shape (n, 3), float64."""
        used = used_vertices(self.triangles.vertices, self.triangles.faces)
        return transform_points(self.placement.world_from_mesh, used)

    def with_size(self, size: float) -> "MeshFile":
        """Return the object with another longest side [m]."""
        scale = stated_scale(size, "auto", self._extent, is_gltf=False)
        assert scale is not None
        factor = scale.metres_per_unit / self.placement.scale.metres_per_unit
        placed = np.diag([factor, factor, factor, 1.0]) @ self.placement.world_from_mesh
        return replace(self, placement=replace(self.placement, world_from_mesh=placed, scale=scale))

    @property
    def longest_side(self) -> float:
        """Of the box along the axes of the file [m]."""
        return float(self._extent.max()) * self.placement.scale.metres_per_unit

    @property
    def _extent(self) -> np.ndarray:
        low, high = box_of(self.triangles.vertices, self.triangles.faces)
        return high - low

    def scene(self, world_from_own: np.ndarray | None = None) -> Scene:
        """Return the object as a scene, moved from its own place by a rigid motion, (4, 4)."""
        at = self.placement.world_from_mesh
        if world_from_own is not None:
            at = world_from_own @ at
        return _scene(self.path, self.triangles, self.materials, at, self.placement)


def load_scene_at(path: Path, world_from_mesh: np.ndarray) -> Scene:
    """Load a mesh file at its pose in a recording.

    Args:
        path: the file.
        world_from_mesh: of the recording: `digs_warp.data.about.About.world_from_mesh`, shape (4, 4).

    Raises:
        MeshError: as `load_scene`.
    """
    return _scene(Path(path), *read_triangles(Path(path)), world_from_mesh)


def _placement(
    path: Path, triangles: Triangles, size: float | None, up: str, unit: str
) -> Placement:
    """Return where the mesh goes: in a pose in which it rests, unless the user names the axis."""
    suffix = path.suffix.lower()
    low, high = box_of(triangles.vertices, triangles.faces)
    scale = stated_scale(size, unit, high - low, suffix in GLTF_SUFFIXES)
    if scale is None:
        scale = _guessed_scale(path, high - low)
    vertices = used_vertices(triangles.vertices, triangles.faces)
    if up != "auto":
        return place(vertices, up, scale)
    usual = place(vertices, UP_AXIS_BY_SUFFIX[suffix], scale)
    turn = resting_turn(transform_points(usual.world_from_mesh, vertices))
    if (turn == np.eye(3)).all():
        return usual
    placement = place(vertices, usual.up, scale, turn)
    logger.log(
        logging.INFO if placement.turned < SAME_POSE else logging.WARNING,
        "mesh '%s': does not rest with %s up; turned by %.1f degrees, so that it does. "
        "--mesh-up %s keeps it as it is",
        *(path.name, placement.up, placement.turned, placement.up),
    )
    return placement


def _guessed_scale(path: Path, extent: np.ndarray) -> Scale:
    """Return a guess; one other than metres is worth a warning, and so is a mug of five metres."""
    guess = guessed_scale(extent, path.suffix[1:].upper())
    in_metres = " x ".join(f"{side * guess.metres_per_unit:.3g}" for side in extent)
    is_likely = guess.metres_per_unit == 1.0 and extent.max() <= LARGE
    level = logging.INFO if is_likely else logging.WARNING
    logger.log(level, "mesh '%s': %s m; %s", path.name, in_metres, guess.origin)
    return guess


def _scene(
    path: Path,
    triangles: Triangles,
    materials: tuple[Material, ...],
    world_from_mesh: np.ndarray,
    placement: Placement | None = None,
) -> Scene:
    """Return the triangles in the world."""
    triangles = drop_unused_vertices(fill_normals(in_world(triangles, world_from_mesh)))
    vertices = triangles.vertices.astype(np.float32)
    size = np.ptp(vertices, axis=0).astype(np.float64)
    return Scene(
        vertices=vertices,
        faces=triangles.faces.astype(np.int32),
        face_materials=triangles.face_materials.astype(np.int32),
        normals=triangles.normals.astype(np.float32),
        uvs=triangles.uvs.astype(np.float32),
        vertex_colors=triangles.colors.astype(np.float32),
        materials=materials,
        objects=(SceneObject(path.stem, path, world_from_mesh, size, placement),),
    )
