"""The list of docs/simulate.md: what can be drawn."""

from digs_warp.sim.record.randomize.randomization import known_keys
from scripts.page_marks import fill

PAGE = "simulate.md"


def main() -> None:
    """Fill the page."""
    for mark, text in texts().items():
        fill(PAGE, mark, text)


def texts() -> dict[str, str]:
    """Return the list by its mark."""
    return {"keys": ", ".join(f"`{key}`" for key in known_keys()) + "."}
