"""The only place that imports dependencies with import-order problems or system libraries.

Each function imports on first call, and says what to install if the import fails.
"""

import importlib
import os
from types import ModuleType

from digs_warp.checks import DigsError

OPEN3D_APT = "apt-get install -y libusb-1.0-0 libegl1 libgl1 libx11-6"
PYRENDER_APT = "apt-get install -y libegl1 libgl1-mesa-dri"


class MissingLibraryError(DigsError):
    """An optional library cannot be loaded; the message has the command that installs what it needs."""


def import_pycolmap() -> ModuleType:
    """Return pycolmap, imported after zlib.

    In the other order, pycolmap's bundled zlib shadows Python's, and every later PNG write in the process
    aborts with ``free(): invalid pointer``.
    """
    importlib.import_module("zlib")
    return importlib.import_module("pycolmap")


def import_open3d() -> ModuleType:
    """Return open3d; its wheel links the system's libusb, libEGL, libGL and libX11."""
    try:
        return importlib.import_module("open3d")
    except (ImportError, OSError) as error:
        raise MissingLibraryError(f"open3d cannot be loaded ({error}): {OPEN3D_APT}") from error


def import_pyrender() -> ModuleType:
    """Return pyrender on EGL; its 0.1.45 asks NumPy for ``infty``, which NumPy 2 no longer has."""
    import numpy as np

    os.environ.setdefault("PYOPENGL_PLATFORM", "egl")
    if not hasattr(np, "infty"):
        setattr(np, "infty", np.inf)  # noqa: B010 (a plain assignment fails type checking)
    try:
        return importlib.import_module("pyrender")
    except (ImportError, OSError, AttributeError) as error:
        raise MissingLibraryError(f"pyrender cannot be loaded ({error}): {PYRENDER_APT}") from error
