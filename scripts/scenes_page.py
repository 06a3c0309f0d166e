"""Record eight scenes and write their pictures and the spread of their depth into docs/scenes.md.

Usage: python scripts/scenes_page.py   (needs the sample data; about a minute)
"""

import sys

from page_marks import DOCS, fill

from digs_warp.study.scene_pictures import REAL, SCENES, DepthSpread, draw_scenes, real_spread
from digs_warp.study.scenes import sample_data
from digs_warp.study.table import Table

PAGE, PICTURES = "scenes.md", "images/scenes"


def main() -> None:
    """Draw the pictures and fill the page."""
    data = sample_data()
    spreads = draw_scenes(data, DOCS / PICTURES)
    fill(PAGE, "pictures", "\n\n".join(section(name) for name in SCENES))
    rows = [row(f"simulated: {name}", spread) for name, spread in spreads.items()]
    rows += [row(f"real: {name}", real_spread(data, name)) for name in REAL]
    headings = ["recording", "median depth [m]", "95 % / 5 %", "the same in a frame"]
    fill(PAGE, "depth", Table("depth", headings, rows).markdown())


def section(name: str) -> str:
    """Return the picture of a scene with what it shows."""
    meshes, surround, _ = SCENES[name]
    return f"{', '.join(meshes)} in {surround}\n\n![{name}]({PICTURES}/{name}.jpg)"


def row(label: str, spread: DepthSpread) -> list[str]:
    """Return a row of the table."""
    return [label, f"{spread.median:.2f}", f"{spread.spread:.1f}", f"{spread.within:.1f}"]


if __name__ == "__main__":
    if sys.argv[1:]:
        sys.exit(__doc__)
    main()
