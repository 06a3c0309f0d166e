"""`load`: one function for every file and folder that holds a recording, a reconstruction or Gaussians."""

from pathlib import Path

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture, read_capture
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.index_rules import INDEX_NAME
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.pipeline.scene_files import read_scene


def load(path: Path | str, prim: str | None = None) -> Capture | Reconstruction | Gaussians:
    """Return what a file or folder holds.

    Args:
        path: a capture folder -> `Capture`; a folder of ``digs-warp reconstruct`` or ``run`` ->
            `Reconstruction`; a file of Gaussians (.npz, .ply, .spz, .splat) or a USD scene -> `Gaussians`.
        prim: path of the splats in a USD scene that shows several fields of them.

    Raises:
        DigsError: there is nothing, it is something else, or it is broken.
    """
    path = Path(path)
    if not path.exists():
        raise DigsError(f"'{path}': no such file or folder. Check the path.")
    if not path.is_dir():
        return read_scene(path, prim=prim).gaussians
    return read_capture(path) if (path / INDEX_NAME).is_file() else Reconstruction.load(path)
