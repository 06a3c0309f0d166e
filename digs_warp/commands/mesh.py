"""`digs-warp mesh`: Gaussians -> a colored triangle mesh."""

import logging
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated

import tyro

from digs_warp.checks import DigsError
from digs_warp.commands.command import Command, SplatOptions
from digs_warp.commands.output import check_output_file
from digs_warp.settings import VOXEL, Range
from digs_warp.surface.true_surface import read_true_surface
from digs_warp.words import counted

if TYPE_CHECKING:
    from digs_warp.data.triangle_mesh import TriangleMesh
    from digs_warp.pipeline.reconstruction import Reconstruction

logger = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class Mesh(Command):
    """Turn Gaussians into a colored triangle mesh.

    Depth is rendered from the cameras of the capture, drawn toward the measured depth where the photographs
    confirm that, and fused (TSDF). For a simulated capture it says how far the mesh lies from the one that
    was recorded.
    """

    source: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="RECONSTRUCTION")]
    """A folder of 'digs-warp reconstruct' or 'run', or Gaussians as .npz, .ply, .spz, .splat or USD."""

    out: Path
    """The mesh to write: .glb (for viewers and Blender) or .ply."""

    overwrite: tyro.conf.FlagCreatePairsOff[bool] = False
    """Replace the file if it exists."""

    capture: Path | None = None
    """The capture that was reconstructed: its cameras see the surface, its masks bound it. Default: the one
    in a folder of 'digs-warp run'; without any, rings of cameras around the object."""

    voxel_size: Annotated[float | None, VOXEL] = None
    """Edge of a voxel, the finest detail [m]. Half the size takes four times the memory. Default: a 160th of
    the object's size."""

    views: Annotated[int, Range(3, 10_000)] = 60
    """How many cameras to use at most, evenly spread; more fill small holes and take longer."""

    scene: Annotated[SplatOptions, tyro.conf.OmitArgPrefixes] = field(default_factory=SplatOptions)

    def execute(self) -> str:
        """Extract, write, and say how good the mesh is where that is known."""
        from digs_warp.data.capture import read_capture
        from digs_warp.pipeline.mesh import extract_mesh
        from digs_warp.surface.files import SUFFIXES, write_mesh

        if self.out.suffix.lower() not in SUFFIXES:
            raise DigsError(
                f"--out '{self.out}': suffix '{self.out.suffix}', expected {' or '.join(SUFFIXES)}"
            )
        check_output_file(self.out, self.overwrite, [self.source, self.capture])
        start = perf_counter()
        capture = read_capture(self.capture) if self.capture else None
        result = self.scene.read(self.source, capture)
        found = extract_mesh(result.gaussians, result.poses, self.voxel_size, self.views)
        write_mesh(self.out, found.mesh)
        lines = [
            f"{self.out}: {counted(len(found.mesh), 'triangle')} from {counted(found.views, 'view')}, "
            f"voxels of {1e3 * found.voxel:.2f} mm, {self.out.stat().st_size / 1e6:.1f} MB, "
            f"{perf_counter() - start:.1f} s",
            _about_depth(found.has_depth, found.trust),
            f"left out as floaters: {counted(found.removed_parts, 'part')} with "
            f"{counted(found.removed_triangles, 'triangle')}",
        ]
        if result.capture is not None:
            lines += _comparison(found.mesh, result, result.capture, 2 * found.voxel)
        return "\n".join(lines)


def _about_depth(has_depth: bool, trust: float) -> str:
    if trust > 0:
        return f"from the depth of the Gaussians and the measured depth, which is trusted by {trust:.0%}"
    why = "the photographs doubt the measured depth" if has_depth else "there is no measured depth"
    return f"from the depth of the Gaussians alone: {why}"


def _comparison(
    mesh: "TriangleMesh", result: "Reconstruction", capture: Path, threshold: float
) -> list[str]:
    """Return a line on the distance to the recorded mesh; none for recordings of real objects."""
    from digs_warp.measure.surface_metrics import surface_score

    try:
        truth = read_true_surface(capture, result.instance, textured=False)
    except DigsError as error:
        logger.warning("%s; the mesh is compared with nothing", error)
        return []
    if truth is None:
        return []
    score = surface_score(mesh.points_world, truth, threshold)
    return [
        f"Chamfer distance to the recorded mesh {1e3 * score.chamfer:.2f} mm (mesh to truth "
        f"{1e3 * score.accuracy:.2f} mm, truth to mesh {1e3 * score.completeness:.2f} mm, unseen parts "
        f"included); F-score {score.f_score:.3f} at {1e3 * threshold:.1f} mm"
    ]
