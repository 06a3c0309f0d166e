"""`digs-warp edit`: cut, thin out, merge and move Gaussians of any format."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from digs_warp.checks import DigsError
from digs_warp.commands.command import Command, SplatOptions
from digs_warp.commands.output import check_output_file
from digs_warp.record.layout import find_gaussians
from digs_warp.settings import ANGLE, Range
from digs_warp.words import counted, format_facts

if TYPE_CHECKING:
    import numpy as np

    from digs_warp.data.gaussians import Gaussians

Triple = tuple[float, float, float]
ZERO: Triple = (0.0, 0.0, 0.0)
LENGTH = Range(-1e9, 1e9, "m")


@dataclass(frozen=True, kw_only=True)
class Edit(Command):
    """Cut, thin out, merge and move Gaussians, from and to every format, and say what they are then.

    'digs-warp edit out/reconstruction --remove-floaters --keep-box -1 -1 0 1 1 2 --out scene.spz'

    In this order: several sources become one, what is not to be kept goes, the rest is thinned out, scaled,
    turned and moved. Boxes are in the world of the source.
    """

    sources: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="SOURCE")]
    """Reconstruction folders, or files of Gaussians. Several are merged, in the world of the first."""

    out: Path
    """The file to write; its suffix decides on the format, as for 'digs-warp convert'."""

    overwrite: tyro.conf.FlagCreatePairsOff[bool] = False
    """Replace the file if it exists."""

    keep_box: Annotated[tuple[float, float, float, float, float, float] | None, LENGTH] = None
    """Keep what lies in a box: its lowest x, y, z, then its highest [m]."""

    keep_inside: Path | None = None
    """Keep what the masks of a capture show, or of a reconstruction: its folder."""

    remove_floaters: tyro.conf.FlagCreatePairsOff[bool] = False
    """Leave out Gaussians without others around them."""

    min_opacity: Annotated[float, Range(0, 1)] = 0.0
    """Leave out Gaussians that are fainter."""

    share: Annotated[float, Range(1e-6, 1)] = 1.0
    """Thin out to at most this share: the least important are dropped, neighbors merged."""

    scale: Annotated[float, Range(1e-9, 1e9)] = 1.0
    """Make it larger by this factor, about the origin."""

    turn: Annotated[Triple, ANGLE] = ZERO
    """Turn it about the fixed axes x, then y, then z [degrees], around the origin; colors turn with it."""

    move: Annotated[Triple, LENGTH] = ZERO
    """Move it by x, y, z [m]."""

    scene: Annotated[SplatOptions, tyro.conf.OmitArgPrefixes] = field(default_factory=SplatOptions)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.sources:
            raise DigsError("SOURCE: none given, expected Gaussians")

    def execute(self) -> str:
        """Edit, write, and say what was left out and what there is."""
        import numpy as np
        from scipy.spatial.transform import Rotation

        from digs_warp.data.gaussians import joined
        from digs_warp.formats.splats.edits import placed
        from digs_warp.formats.splats.files import SplatWriting
        from digs_warp.pipeline.reconstruction import Reconstruction
        from digs_warp.pipeline.scene_files import check_target, write_scene_file
        from digs_warp.show.report.facts import describe
        from digs_warp.usd.frames import Similarity
        from digs_warp.usd.lod import level_of_detail

        check_target(self.out)
        check_output_file(self.out, self.overwrite, [find_gaussians(each) for each in self.sources])
        parts = [self.scene.read(source).gaussians for source in self.sources]
        gaussians = joined([part.less(parts[0].world_offset) for part in parts])
        steps = {"read": counted(len(gaussians), "Gaussian")}
        for name, keep in self._kept():
            gaussians = gaussians.select(keep(gaussians))
            steps[name] = f"{counted(len(gaussians), 'Gaussian')} left"
        if not len(gaussians):
            raise DigsError(f"'{self.out}': no Gaussian is left ({steps}); keep more")
        if self.share < 1:
            gaussians = level_of_detail(gaussians, self.share)
            steps["thinned out"] = f"{counted(len(gaussians), 'Gaussian')} left"
        turn = Rotation.from_euler("xyz", self.turn, degrees=True).as_matrix()
        similarity = Similarity(self.scale, turn, np.array(self.move))
        if (self.scale, self.turn, self.move) != (1.0, ZERO, ZERO):
            gaussians = placed(gaussians, similarity)
        result = Reconstruction(gaussians=gaussians)
        write_scene_file(self.out, result, self.sources[0], SplatWriting(up=self.scene.up))
        return format_facts(steps | {"written": str(self.out)} | describe(self.out))

    def _kept(self) -> "Iterator[tuple[str, Callable[[Gaussians], np.ndarray]]]":
        """Yield what keeps which Gaussians, with its name."""
        import numpy as np

        from digs_warp.data.layers import Layer
        from digs_warp.formats.splats.edits import in_box, in_masks, no_floater
        from digs_warp.pipeline.scene_files import posed_capture

        if self.keep_box is not None:
            low, high = np.array(self.keep_box).reshape(2, 3)
            if not (low < high).all():
                raise DigsError(
                    f"--keep-box: {self.keep_box}, expected its lowest x, y, z, then its highest"
                )
            yield "in the box", lambda g: in_box(g, low, high)
        if self.keep_inside is not None:
            capture = posed_capture(self.keep_inside)
            if not any(frame.has(Layer.MASK) for frame in capture.frames):
                raise DigsError(f"--keep-inside '{self.keep_inside}': there are no masks in it")
            offset = capture.about.world_offset
            yield "in the masks", lambda g: in_masks(g.less(offset), capture.frames)
        if self.remove_floaters:
            yield "without floaters", no_floater
        if self.min_opacity > 0:
            yield "opaque enough", lambda g: g.opacities >= self.min_opacity
