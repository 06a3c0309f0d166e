"""The part of `digs-warp convert` that turns Gaussians of one format into another."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from digs_warp.commands.output import check_output_file
from digs_warp.commands.splat_options import SplatOptions
from digs_warp.record.layout import find_gaussians
from digs_warp.words import counted


@dataclass(frozen=True, kw_only=True)
class SplatConversion(SplatOptions):
    """For Gaussians: what the files of other programs do not say or leave open."""

    spz_version: Literal[2, 3, 4] = 3
    """Version of SPZ files to write. 3: read by nearly all programs; 4: the same content in the newest
    container; 2: for the oldest programs, with coarser orientations."""

    vertex_colors: bool = True
    """Also write red, green and blue to PLY files, so that Open3D, trimesh and MeshLab show the splats as
    colored points. Leave them out for programs that expect rows of floats only: the SIBR viewer of 3D
    Gaussian splatting, and old versions of UnityGaussianSplatting."""


def convert_splats(source: Path, target: Path, overwrite: bool, options: SplatConversion) -> str:
    """Read ``source``, write ``target``, and return a line for the user.

    Raises:
        DigsError: the source cannot be used, or the target not be written.
    """
    from digs_warp.pipeline.scene_files import check_target, write_scene_file

    check_target(target)
    check_output_file(target, overwrite, [find_gaussians(source)])
    result = options.read(source)
    write_scene_file(target, result, source, options.up, options.spz_version, options.vertex_colors)
    gaussians = result.gaussians
    size = target.stat().st_size / 1e6
    return f"{target}: {counted(len(gaussians), 'Gaussian')} of degree {gaussians.sh_degree}, {size:.2f} MB"
