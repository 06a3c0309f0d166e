"""The planes that hold a view, or a gradient in it, as kernels take them."""

from dataclasses import dataclass
from typing import Any

from digs_warp.device.image_planes import ImagePlanes
from digs_warp.device.parallel import packed
from digs_warp.splat.records import Planes


@dataclass(frozen=True, eq=False)
class ViewPlanes:
    """The planes of a view, or of a gradient in it; those that are not wanted have no channels."""

    image: ImagePlanes
    transmittance: ImagePlanes
    depth: ImagePlanes
    normals: ImagePlanes

    def resize(self, width: int, height: int) -> None:
        """Hold a view of another size."""
        for planes in vars(self).values():
            planes.resize(width, height)

    def for_kernels(self) -> Any:
        """Return the planes as kernels take them, `Planes`."""
        layout = {name: getattr(self.image, name) for name in ("pitch", "plane", "origin")}
        return packed(Planes, **layout, **{name: p.data for name, p in vars(self).items()})
