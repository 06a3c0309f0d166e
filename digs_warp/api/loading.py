"""`load`: one function for every file and folder that holds a recording, a reconstruction or Gaussians."""

from pathlib import Path

from digs_warp.checks import DigsError
from digs_warp.data.capture import INDEX_NAME, Capture, read_capture
from digs_warp.data.gaussians import Gaussians
from digs_warp.record.layout import find_gaussians

USD_SUFFIXES = (".usd", ".usda", ".usdc", ".usdz")


def load(path: Path | str) -> Capture | Gaussians:
    """Return what a file or folder holds.

    Args:
        path: a capture folder -> `Capture`; a folder of ``digs-warp reconstruct`` or ``run``; a file of
            Gaussians (.npz, .ply, .spz, .splat) or a USD scene -> `Gaussians`.

    Raises:
        DigsError: there is nothing, it is something else, or it is broken.
    """
    from digs_warp.interchange.splats.files import SUFFIXES, read_splat_file

    path = Path(path)
    if not path.exists():
        raise DigsError(f"'{path}': no such file or folder. Check the path.")
    if path.is_dir():
        return _load_folder(path)
    suffix = path.suffix.lower()
    if suffix == ".npz":
        return Gaussians.load(path)
    if suffix in SUFFIXES:
        return read_splat_file(path)
    if suffix in USD_SUFFIXES:
        from digs_warp.usd.reader import read_gaussians

        return read_gaussians(path)
    known = ", ".join((".npz", *SUFFIXES, *USD_SUFFIXES))
    raise DigsError(f"'{path}': cannot load '{path.suffix}'; expected a folder or one of {known}")


def _load_folder(path: Path) -> Capture | Gaussians:
    if (path / INDEX_NAME).is_file():
        return read_capture(path)
    return Gaussians.load(find_gaussians(path))
