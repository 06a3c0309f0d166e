"""Measure the simulated depth sensor against real matching and write docs/sensor-cost.md.

Usage: python scripts/sensor_cost_page.py   (about two minutes; keep the machine quiet meanwhile)
"""

from importlib.metadata import version
from pathlib import Path

from digs_warp.record.progress import show_progress
from digs_warp.study.bench_sim import bench_sim
from digs_warp.study.plot_sim import plot_sim
from digs_warp.study.results import Result, format_number

DOCS = Path(__file__).resolve().parent.parent / "docs"

TEXT = """# The simulated depth sensor: what accuracy costs in time

This page is written by `make sensor-cost`; `digs-warp bench sim` prints the same numbers. Measured with
OpenCV {opencv} and Warp {warp} on two cores at 1280 x 720. *time* is per frame while two are sensed side by
side, as a recording does it, and without what a recording does once (planning, compiling); *CPU* is what both
cores spend on a frame meanwhile. The best of five rounds; times belong to the machine, which other work may
have shared.

![Tiers and effects by time and by their gap to real matching](images/sensor-cost.png)

The yardstick is the `matcher` tier: semi-global matching of the two images as the camera records them, with
vignetting, shot and read noise. `planned` does not look at the right image at all. Its effects are fitted to
that matcher and to a real pair with true disparity (Middlebury Motorcycle, quarter size), the last rows.

*fill*: share of the pixels with a value. *bad-1*: share of the values that are wrong by more than a pixel.
*rms*: of the other errors. *edge bad-1*: bad-1 within two pixels of a depth step. *occluded holes*: share
of the pixels hidden from the right eye that have no value.

## Tiers

{tiers}

## Causes

What share of the frame each cause takes, in the mean of the rendered scenes, told from disparity and truth
by one rule for both tiers.

{causes}

## Effects

*alone*: time of the effect alone, rays and all. *changes*: planned tier with the effect minus without it.
*nearer*: by how much smaller the gap to the matcher is with the effect than without; negative: larger.

{effects}

## Where the planned tier is off

- **Edges.** Next to steps the matcher is wrong more often. Before a background whose texture drowns in the
  noise it carries a strong outline five pixels and more into what is hidden behind it; here the hidden pixels
  are drawn one patch at a time. On the real pair part of the difference is the truth itself, which blends
  both sides of a step over a pixel or two.
- **Strips.** Weakly textured areas fail in strips along the rows, as in semi-global matching. How many fail
  follows the texture in both; which ones is drawn here, and the noise of the two images decides there.
- **Weak texture of the real pair** costs the matcher less than that of rendered images at the same ratio of
  gradient to noise: the rays of a pixel add a grain of their own to rendered images.
- **Noise of the real pair** is higher than the model's (rms above): the grain of its images, half a grey
  level, explains little of it; the eyes differ by more than grain, and the true disparity has an error of its
  own.
- **Repeated texture** is not modelled: a matcher may lock on to the wrong period.
- **Time on the real pair.** Its nearest point asks for a search over 80 disparities, the nearest depth of the
  rendered rig for 448. Matching costs time in proportion; the planned tier does not care. With so little to
  search, matching is only a few times as slow.
- **Flying pixels** and holes in saturated areas belong to the profile's device, not to plain matching:
  they widen the gap where they act, and are right to.
"""

TABLES = {"tiers": "sensor", "causes": "cause", "effects": "effect"}


def main() -> None:
    """Measure, draw and write the page."""
    show_progress()
    results = bench_sim()
    (DOCS / "images" / "sensor-cost.png").write_bytes(plot_sim(results))
    tables = {
        name: table([r for r in results if key in r.settings]) for name, key in TABLES.items()
    }
    page = TEXT.format(
        opencv=version("opencv-python-headless"), warp=version("warp-lang"), **tables
    )
    (DOCS / "sensor-cost.md").write_text(page, encoding="utf-8")
    print(DOCS / "sensor-cost.md")  # noqa: T201 (a script)


def table(results: list[Result]) -> str:
    """Return a Markdown table: one row per settings, one column per name."""
    rows: dict[tuple[str, ...], dict[str, float]] = {}
    for result in results:
        rows.setdefault(tuple(result.settings.values()), {})[result.name] = result.value
    keys, names = list(results[0].settings), list(dict.fromkeys(r.name for r in results))
    lines = [f"| {' | '.join([*keys, *names])} |", "|---" * len(keys) + "|--:" * len(names) + "|"]
    lines += [
        f"| {' | '.join([*settings, *(cell(name, values[name]) for name in names)])} |"
        for settings, values in rows.items()
    ]
    return "\n".join(lines)


def cell(name: str, value: float) -> str:
    """Return a number as it stands in the table: times with four digits, the rest to a thousandth."""
    if "ms/MP" in name:
        return format_number(value)
    sign = "+" if name.startswith(("changes", "nearer")) else ""
    return f"{value:{sign}.3f}"


if __name__ == "__main__":
    main()
