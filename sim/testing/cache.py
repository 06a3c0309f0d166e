"""Captures of the noise tests, kept between test runs."""

import hashlib
import re
import shutil
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from digs_warp.data.capture import Capture, read_capture
from digs_warp.record.disk import rename
from digs_warp.record.files import to_json
from digs_warp.record.lock import taking_turns
from digs_warp.record.run_log import versions
from digs_warp.sim.testing.sources import KEY_LENGTH, NoiseSource

_KEY = re.compile(f"[0-9a-f]{{{KEY_LENGTH}}}")

# Folders of this package and the files below it whose code decides the bytes of a capture.
_SOURCES = ("*.py", "data/*.py", "device/*.py", "record/*.py", "sim/**/*.py")


@dataclass(frozen=True)
class CaptureCache:
    """A folder of captures, each made once.

    The name of a capture is the key of its source. Captures lie in a folder named by a hash of the code and
    packages that make them; folders of other code are removed.
    """

    folder: Path

    def capture(self, source: NoiseSource, strength: float) -> Capture:
        """Return the capture at a strength; makes it when it is not there yet."""
        folder = self.folder / _code_key() / source.key(strength)
        if not folder.is_dir():
            with taking_turns(folder):  # test processes may run side by side: one makes it
                if not folder.is_dir():
                    self._remove_others(folder.parent)
                    # A killed run left a part there.
                    unfinished = folder.with_name(f".{folder.name}.unfinished")
                    source.write(strength, unfinished)
                    rename(unfinished, folder)
        return read_capture(folder)

    def _remove_others(self, current: Path) -> None:
        """Delete the captures of other code; what is not named like them is none of ours."""
        for other in self.folder.iterdir():
            if other != current and _KEY.fullmatch(other.name) and not other.is_symlink():
                shutil.rmtree(other, ignore_errors=True)


@cache
def _code_key() -> str:
    root = Path(__file__).parents[2]
    digest = hashlib.sha256(to_json(versions()).encode())
    for path in sorted(path for pattern in _SOURCES for path in root.glob(pattern)):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:KEY_LENGTH]
