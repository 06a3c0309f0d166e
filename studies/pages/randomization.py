"""The tables of docs/simulate.md: what can be drawn, and what the shipped randomizations draw."""

from digs_warp.sim.record.randomize.draws import SHIPPED, known_keys, load_randomization
from digs_warp.study.table import Table
from scripts.page_marks import fill

PAGE = "simulate.md"


def main() -> None:
    """Fill the page."""
    for mark, text in texts().items():
        fill(PAGE, mark, text)


def texts() -> dict[str, str]:
    """Return the tables by mark."""
    ours = {name: load_randomization(name).entries for name in SHIPPED}
    drawn = [key for key in known_keys() if any(key in entries for entries in ours.values())]
    shipped = [
        [f"`{key}`", *(f"`{e[key].words}`" if key in e else "" for e in ours.values())]
        for key in drawn
    ]
    return {
        "ours": Table("ours", ["key", *(f"`{name}`" for name in ours)], shipped).markdown(),
        "keys": ", ".join(f"`{key}`" for key in known_keys()) + ".",
    }
