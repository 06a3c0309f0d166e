"""Variant sets of a stage: selected by name, or all combinations one after the other.

Choices are made in the session layer: the file does not change.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from digs_warp.checks import UsdError

if TYPE_CHECKING:
    from pxr import Usd

# A choice: (path of the prim, name of its variant set) -> name of the variant.
Selection = dict[tuple[str, str], str]


def variant_sets(stage: "Usd.Stage") -> dict[tuple[str, str], list[str]]:
    """Return the variants of every set in the current composition, by (prim path, set)."""
    return {
        (str(prim.GetPath()), name): list(prim.GetVariantSet(name).GetVariantNames())
        for prim in stage.TraverseAll()
        for name in prim.GetVariantSets().GetNames()
    }


def select_variants(stage: "Usd.Stage", chosen: Mapping[str, str], path: Path) -> None:
    """Choose variants by the names of their sets, on every prim that has such a set.

    Sets inside other variants are found once those are chosen: the order of ``chosen`` counts.

    Raises:
        UsdError: there is no such set or no such variant; lists all of them.
    """
    for name, variant in chosen.items():
        found = {key: names for key, names in variant_sets(stage).items() if key[1] == name}
        if not any(variant in names for names in found.values()):
            there = "; ".join(f"{s}: {', '.join(v)}" for (_, s), v in variant_sets(stage).items())
            raise UsdError(
                f"USD scene '{path}': no variant '{variant}' of '{name}'; there is {there or 'none'}"
            )
        for (prim, _), names in found.items():
            if variant in names:
                _select(stage, prim, name, variant)


def variant_combinations(stage: "Usd.Stage") -> Iterator[Selection]:
    """Put the stage into every combination of its variants in turn; yield what is chosen.

    A stage without variants is yielded once, with nothing chosen.
    """
    yield from _combinations(stage, {})


def _combinations(stage: "Usd.Stage", chosen: Selection) -> Iterator[Selection]:
    # A selection may add sets: nested ones, or those of a payload.
    for key, names in variant_sets(stage).items():
        if key not in chosen and names:
            for variant in names:
                _select(stage, *key, variant)
                yield from _combinations(stage, chosen | {key: variant})
            return
    yield chosen


def _select(stage: "Usd.Stage", prim: str, name: str, variant: str) -> None:
    from pxr import Usd

    with Usd.EditContext(stage, stage.GetSessionLayer()):
        stage.GetPrimAtPath(prim).GetVariantSet(name).SetVariantSelection(variant)
