"""Trade-offs that are decided after the training: alpha cut and export precision."""

from collections.abc import Mapping, Sequence
from typing import Any

from digs_warp.splat.config import TILE_SIZE
from digs_warp.study.engine.records import Record, Spread
from digs_warp.study.page import Section
from digs_warp.study.table import Table


def finish_sections(usual: Sequence[Record]) -> list[Section]:
    """Return the choices after the training, measured on results of the usual settings."""
    found = [r["finishes"] for r in usual if r.get("finishes")]
    if not found:
        return []
    cuts = _finish_rows([f["alpha_cuts"] for f in found], "seconds", 1e3, 2)
    stored = _finish_rows([f["precisions"] for f in found], "megabytes", 1.0, 2)
    cut_text = (
        "The faintest alpha that is still drawn. A higher cut makes splats smaller and views faster, but "
        "soft edges suffer. The training uses the first value."
    )
    stored_text = (
        "The precision of the numbers in the USD scene (--precision). 'mixed' keeps the positions exact. The "
        "loss is rarely visible; the gain is disk space and loading time."
    )
    return [
        Section(
            "Alpha cut",
            cut_text,
            [Table("alpha_cut", ["alpha cut", "ms per view", "PSNR [dB]"], cuts)],
        ),
        Section(
            "Export precision",
            stored_text,
            [Table("precision", ["precision", "MB", "PSNR [dB]"], stored)],
        ),
        _tiles(),
    ]


def _finish_rows(
    measured: Sequence[Sequence[Mapping[str, Any]]], cost: str, factor: float, decimals: int
) -> list[list[str]]:
    """Return value, mean cost and mean PSNR of each choice; every result has the same choices."""
    rows = []
    for same in zip(*measured, strict=True):
        paid = Spread.of(factor * choice[cost] for choice in same)
        quality = Spread.of(choice["psnr"] for choice in same)
        assert paid and quality
        rows.append([str(same[0]["value"]), paid.text(decimals), quality.text(2)])
    return rows


def _tiles() -> Section:
    text = (
        f"{TILE_SIZE} x {TILE_SIZE} pixels, not adjustable: the kernels hold a row of a tile in vector "
        "registers, so another size would need another kernel."
    )
    return Section("Tile size", text)
