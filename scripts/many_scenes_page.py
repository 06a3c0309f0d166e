"""Write figures into docs/many-scenes.md: the plan for ten thousand scenes, and what a killed worker costs.

Usage: python scripts/many_scenes_page.py [plan] [killed]   (default: both; killed takes ten minutes)
"""

import platform
import shlex
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from killed_worker import trial
from page_marks import fill

from digs_warp import cli
from digs_warp.study.machine import processor

PAGE = "many-scenes.md"
# A usual price of a core for an hour with cloud providers [US dollars]; yours is another.
PLAN = ["study", "plan", "--scenes", "10000", "--cores", "64", "--price", "0.05"]
STUDY = ["--study", "docs/study/scaling"]


def main(names: Sequence[str]) -> None:
    """Write the named parts of the page, or all."""
    parts = {"plan": plan, "killed": killed}
    if not parts.keys() >= set(names):
        sys.exit(__doc__)
    for name in names or parts:
        page = fill(PAGE, name, parts[name]())
        sys.stdout.write(f"{page}: {name}\n")


def plan() -> str:
    """Return the plan by the published study."""
    text = cli.parse([*PLAN, *STUDY]).execute()
    command = shlex.join(["digs-warp", *PLAN])
    return f"```console\n$ {command}\n{text}\n```"


def killed() -> str:
    """Measure many reconstructions on two workers, one killed, and return the table."""
    with tempfile.TemporaryDirectory() as folder:
        table = trial(Path(folder)).markdown()
    return f"{table}\n\nMeasured on {processor()}, {platform.system()}."


if __name__ == "__main__":
    main(sys.argv[1:])
