"""The tables of docs/simulate.md: what can be drawn, and what the shipped randomizations draw."""

from typing import Any

from digs_warp.sim.record.randomize.settings_file import SHIPPED, known_keys, load_randomization
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
    keys = [[f"`{key.name}`", values_of(key)] for key in known_keys().values()]
    return {
        "ours": Table("ours", ["key", *(f"`{name}`" for name in ours)], shipped).markdown(),
        "keys": Table("keys", ["key", "values"], keys).markdown(),
    }


def values_of(key: Any) -> str:
    """Return in words what a key takes."""
    items = ", ".join(f"`{word}`" for word in key.words) or key.kind
    whole = f"list: {items}" if key.is_list else items
    return f"{whole}; one draw for each object" if key.per_object else whole
