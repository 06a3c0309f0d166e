"""Write what a killed worker costs into docs/many-scenes.md.

Usage: python scripts/many_scenes_page.py   (ten minutes)
"""

import platform
import tempfile
from pathlib import Path

from killed_worker import trial
from page_marks import fill

from digs_warp.study.machine import processor

PAGE = "many-scenes.md"


def killed() -> str:
    """Measure many reconstructions on two workers, one killed, and return the table."""
    with tempfile.TemporaryDirectory() as folder:
        table = trial(Path(folder)).markdown()
    return f"{table}\n\nMeasured on {processor()}, {platform.system()}."


if __name__ == "__main__":
    fill(PAGE, "killed", killed())
