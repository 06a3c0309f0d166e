"""What a killed worker costs, for docs/many-scenes.md; takes ten minutes."""

import tempfile
from pathlib import Path

from scripts.killed_worker import trial
from scripts.page_marks import fill
from studies.pages import measured_on


def main() -> None:
    """Measure many reconstructions on two workers, one killed, and write the table."""
    with tempfile.TemporaryDirectory() as folder:
        table = trial(Path(folder)).markdown()
    fill("many-scenes.md", "killed", f"{table}\n\n{measured_on()}")
