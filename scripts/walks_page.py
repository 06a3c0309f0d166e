"""Write the comparison of simulated walks with a recorded one into docs/walks.md.

Usage: python scripts/walks_page.py   (needs the sample data; some seconds)
"""

import sys

from page_marks import fill

from digs_warp.sim.camera.walk.settings import WalkSettings
from digs_warp.study.hand_motion import figures, recorded_walk, simulated_figures
from digs_warp.study.scenes import sample_data
from digs_warp.study.table import Table


def main() -> None:
    """Fill the page."""
    walk = recorded_walk(sample_data())
    recorded, simulated = figures(walk), simulated_figures(walk.times)
    # A perfect path: what the simulator did before hands, but for the shake.
    shaken = simulated_figures(walk.times, WalkSettings(unsteadiness=0.0))
    rows = [
        [
            name,
            f"{value:.2f}",
            f"{simulated[name].mean():.2f} ({simulated[name][1]:.2f} to {simulated[name][-2]:.2f})",
            f"{shaken[name].mean():.2f}",
        ]
        for name, value in recorded.items()
    ]
    headings = ["", "recorded", "simulated, mean (5 to 95 % of 20)", "with `unsteadiness: 0`"]
    fill("walks.md", "hand", Table("hand", headings, rows).markdown())


if __name__ == "__main__":
    if sys.argv[1:]:
        sys.exit(__doc__)
    main()
