"""Write the plan for ten thousand scenes into docs/many-scenes.md.

Usage: python scripts/many_scenes_page.py
"""

import shlex
import sys
from collections.abc import Sequence

from page_marks import fill

from digs_warp import cli

PAGE = "many-scenes.md"
# A usual price of a core for an hour with cloud providers [US dollars]; yours is another.
PLAN = ["study", "plan", "--scenes", "10000", "--cores", "64", "--price", "0.05"]
STUDY = ["--study", "docs/study/scaling"]


def main(arguments: Sequence[str]) -> None:
    """Compute the plan by the published study and write it between the marks."""
    if arguments:
        sys.exit(__doc__)
    text = cli.parse([*PLAN, *STUDY]).execute()
    command = shlex.join(["digs-warp", *PLAN])
    page = fill(PAGE, "plan", f"```console\n$ {command}\n{text}\n```")
    sys.stdout.write(f"{page}\n")


if __name__ == "__main__":
    main(sys.argv[1:])
