"""The only place that imports dependencies with import-order problems or system libraries.

Each function imports on first call, and says what to install if the import fails.
"""

import importlib
import os
import signal
import threading
from types import ModuleType

from digs_warp.checks import DigsError

OPEN3D_APT = "apt-get install -y libusb-1.0-0 libegl1 libgl1 libx11-6"
PYRENDER_APT = "apt-get install -y libegl1 libgl1-mesa-dri"


# The packages whose modules have other names.
PACKAGES = {
    **{"cv2": "opencv-python-headless", "PIL": "pillow", "pxr": "usd-core"},
    **{"sklearn": "scikit-learn", "warp": "warp-lang", "yaml": "pyyaml"},
}


class MissingLibraryError(DigsError):
    """A library cannot be loaded; the message has the command that installs what it needs."""


def missing_library(error: ImportError) -> MissingLibraryError | None:
    """Return the error to show for a failed import of another package; None for one of our own modules."""
    module = (error.name or "digs_warp").partition(".")[0]
    if module == "digs_warp":
        return None
    package = PACKAGES.get(module, module)
    return MissingLibraryError(
        f"this needs the package '{package}', which cannot be loaded ({error}); install it with: "
        f"pip install {package}"
    )


def import_pycolmap() -> ModuleType:
    """Return pycolmap, imported after zlib; SIGTERM is left as it was.

    In the other order, pycolmap's bundled zlib shadows Python's, and every later PNG write in the process
    aborts with ``free(): invalid pointer``. Its log library takes SIGTERM and prints a stack trace: a command
    would not end in order.

    Raises:
        MissingLibraryError: it is not installed. Only structure from motion and exports to COLMAP need it.
    """
    importlib.import_module("zlib")
    handler = signal.getsignal(signal.SIGTERM)
    try:
        pycolmap = importlib.import_module("pycolmap")
    except ImportError as error:
        raise MissingLibraryError(
            "structure from motion and exports to COLMAP need the package 'pycolmap', which cannot be loaded "
            f"({error}); install it with: pip install pycolmap. Or do without: --poses capture, and a "
            "--strategy from depth."
        ) from error
    # Python sets signals in its main thread only; None is a handler that Python did not set.
    if threading.current_thread() is threading.main_thread() and handler is not None:
        signal.signal(signal.SIGTERM, handler)
    return pycolmap


def import_open3d() -> ModuleType:
    """Return open3d; its wheel links the system's libusb, libEGL, libGL and libX11."""
    try:
        return importlib.import_module("open3d")
    except (ImportError, OSError) as error:
        raise _not_loaded("open3d", error, OPEN3D_APT) from error


def import_pyrender() -> ModuleType:
    """Return pyrender on EGL; its 0.1.45 asks NumPy for ``infty``, which NumPy 2 no longer has."""
    import numpy as np

    os.environ.setdefault("PYOPENGL_PLATFORM", "egl")
    if not hasattr(np, "infty"):
        setattr(np, "infty", np.inf)  # noqa: B010 (a plain assignment fails type checking)
    try:
        return importlib.import_module("pyrender")
    except (ImportError, OSError, AttributeError) as error:
        raise _not_loaded("pyrender", error, PYRENDER_APT) from error


def _not_loaded(package: str, error: Exception, system_libraries: str) -> MissingLibraryError:
    """Say what to install: the package, or the libraries of the system that it links."""
    is_absent = isinstance(error, ModuleNotFoundError) and error.name == package
    remedy = f"pip install {package}" if is_absent else system_libraries
    return MissingLibraryError(f"the package '{package}' cannot be loaded ({error}): {remedy}")
