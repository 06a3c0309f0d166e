"""Write docs/initialization.md, figures and all.

Usage: python scripts/initialization_page.py [FOLDER]   (a quarter of an hour; keep the machine quiet)

FOLDER: take the results of `digs-warp bench NAME --json FOLDER/NAME.jsonl` for the names init, init-noise and
init-ablation, where they are, instead of measuring again.
"""

import json
import sys
from pathlib import Path

from digs_warp.log import show_progress
from digs_warp.study.benchmarks import BENCHMARKS
from digs_warp.study.results import Result, format_number

DOCS = Path(__file__).resolve().parent.parent / "docs"

TEXT = """# Initialization: from depth maps to the first Gaussians

`scripts/initialization_page.py` writes this page, tables and all; `digs-warp bench` prints the same numbers
under the names `init`, `init-noise` and `init-ablation`. [method.md](method.md) maps the paper's equations to
files.

![The five initializations of one recording](images/initialization.jpg)

(`scripts/initialization_picture.py` draws it. Sparse points and the cube of random ones reach far behind the
object; of the depth, the object is left.)

## Which strategy

| strategy | points | take it |
|---|---|---|
| `highdepth` (default) | depth maps, voxels of 4 mm | whenever there is depth |
| `depth` | depth maps, voxels of 10 mm | for a preview, or for density control to fill in |
| `fusion` | highdepth and the sparse points on the object | when fine texture matters most |
| `default` | sparse points, background included: what 3DGS starts from | without depth, or to compare |
| `random` | random points where the cameras look | to compare |

```sh
digs-warp reconstruct out/capture --out out/fused --poses sfm --strategy fusion
digs-warp reconstruct out/capture --out out/small --target-points 5000
digs-warp reconstruct out/capture --out out/paper --poses sfm --voxel-unit sfm
```

## From a depth map to points

1. Pixels inside the mask (above 20 of 255) that have depth.
2. Away from jumps of the depth: the 5x5 Laplacian is below its mean plus a tenth of its deviation. Pixels
   without depth make no edges, but next to a large hole too little is known, and the pixel goes.
3. In the nearer one of two clusters of depth, or, more exactly, in the one that holds most of the mask.
   This catches masks that leak. It cannot help where background touches the object, and does nothing where
   no background was measured.
4. Back-projected, and averaged per voxel: a recording is reduced view by view and never held in memory.
5. Voxels with fewer than 15 % of the median number of measurements go (ours; `--min-support 0` keeps them).
6. Points that more views saw through than saw go (ours; `--no-visibility-check` keeps them): a view that
   measured the wall behind a point has looked through it.

With `--poses sfm` the scale comes first: every sparse point that a view saw gives a ratio of its depth in
the model to the measured one, and the mode of all ratios is the scale. A warning names a second mode that
is nearly as high: it means that some frames have depth in another unit.

## Speed

{bench_settings}. Reading files is not counted; the frames are a few simulated ones that lie in memory. CPU
times are of all threads together.

{bench}

## Sensor noise and calibration errors

Simulated depth at 0, 1, 2 and 4 times the errors of the camera, 640 px wide; poses from a model in an
unknown unit, whose scale is recovered from the same depth. *Chamfer*: mean of the distances from the points
to the true surface and back. *from surface* counts what no camera saw, too.

{noise}

- **A wrong baseline** (5 % too large) makes all depths 5 % too large. The scale takes it up, and the points
  lie where they should, in a world whose metre is 5 % too long.
- **Disparities that are 0.2 px too large** stretch depth by a share that depends on the depth. One factor
  cannot take that up: what is left is how far the points move.

The scale stays within a thousandth of the truth under every single effect of the simulator at strength 1,
and within 2 % under all of them together at strength 4 (`tests/digs_warp/init/test_scale_under_noise.py`).

## What each component is worth

The built-in object with the planned sensor at strength 1; every other mask leaks. Each row changes one
thing in the paper's recipe; "+" adds an extension of ours. Where there is a PSNR, it is that of held-out
views after so many steps of training with the true masks.

{ablation}

- The k-means keeps out the walls that leaking masks let in, the edge filter the pixels that float between the
  object and what is behind it. Neither replaces the other, and without masks both still find the object.
- A few mismatched features are enough to spoil the mean of the ratios; their mode does not notice.
- The voxel grid evens out how often a surface was seen, and gives a single stray the weight of a
  well-measured voxel. The visibility check takes the strays back.

Extensions that are off unless a flag turns them on: `--weight-by-uncertainty` (1 / depth^4),
`--weight-by-confidence`, `--shape flat` (thin along the normal of the depth maps), `--shape ray` (drawn out
along the line of sight by the uncertainty of depth).

## What the paper leaves open

- **Units of the voxel size.** Units of structure from motion are arbitrary. Sizes in metres are the
  default; `--voxel-unit object` gives a cup and a car the same number of points, `--voxel-unit sfm` is the
  paper's, `--target-points` searches for the size.
- **How the k-means weights enter.** A pixel is background where it is three times as near to the
  background's mean depth as to the foreground's. The means are those of the best split of all depths of the
  view, without weights.
- **Where random points lie.** In the cube around the point that all cameras look at, as large as the image
  shows there; as many as structure from motion found.
"""

KINDS = {"points": ",.0f", "mm": ".2f", "share": ".4f", "dB": ".2f", "s": ".2f", "GB": ".2f"}


def main() -> None:
    """Measure, or read what was measured, and write the page."""
    show_progress()
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else None
    bench = results_of("init", folder)
    shared = bench[0].settings
    settings = f"{shared['frames']} frames of {shared['size']} depth on {shared['threads']} threads"
    page = TEXT.format(
        bench_settings=settings,
        bench=by_strategy(bench),
        noise=wide_table(results_of("init-noise", folder)),
        ablation=wide_table(results_of("init-ablation", folder)),
    )
    target = DOCS / "initialization.md"
    target.write_text(page, encoding="utf-8")
    print(target)  # noqa: T201 (a script)


def results_of(name: str, folder: Path | None) -> list[Result]:
    """Return the results of a benchmark, from its file in the folder where that is there."""
    path = folder / f"{name}.jsonl" if folder else None
    if path is not None and path.is_file():
        lines = path.read_text(encoding="utf-8").splitlines()
        return [Result(**json.loads(line)) for line in lines]
    (benchmark,) = (b for b in BENCHMARKS if b.name == name)
    return benchmark.run()


def by_strategy(results: list[Result]) -> str:
    """Return a Markdown table: what was measured down, strategies across; then what is no strategy's."""
    strategies = [s for s in dict.fromkeys(r.settings.get("strategy", "") for r in results) if s]
    cells = {(r.name, r.settings.get("strategy", "")): cell(r) for r in results}
    names = list(dict.fromkeys(r.name for r in results))
    lines = ["| | " + " | ".join(strategies) + " |", "|---|" + "---|" * len(strategies)]
    for name in names:
        row = [cells.get((name, strategy), "") for strategy in strategies]
        if any(row):
            lines.append(f"| {name} | " + " | ".join(row) + " |")
    return "\n".join(lines)


def wide_table(results: list[Result]) -> str:
    """Return a Markdown table: settings down, names across."""
    keys, names = list(results[0].settings), list(dict.fromkeys(r.name for r in results))
    rows: dict[tuple[str, ...], dict[str, str]] = {}
    for r in results:
        rows.setdefault(tuple(map(str, r.settings.values())), {})[r.name] = number(r)
    lines = ["| " + " | ".join([*keys, *names]) + " |", "|" + "---|" * (len(keys) + len(names))]
    for settings, values in rows.items():
        lines.append("| " + " | ".join([*settings, *(values.get(n, "") for n in names)]) + " |")
    return "\n".join(lines)


def number(result: Result) -> str:
    """Return the value with the digits of its unit."""
    return (
        format(result.value, KINDS[result.unit])
        if result.unit in KINDS
        else format_number(result.value)
    )


def cell(result: Result) -> str:
    """Return value and unit; of counts and shares the value alone."""
    return (
        number(result) if result.unit in ("points", "share") else f"{number(result)} {result.unit}"
    )


if __name__ == "__main__":
    main()
