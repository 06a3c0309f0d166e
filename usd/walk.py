"""Everything that a stage can show: all variants and all values. Imports nothing but OpenUSD.

As a program it walks through a file under limits. OpenUSD trusts the tables of its files: a broken one may
end the process or take all of its memory, so `digs_warp.usd.files` tries it in a process of its own first.
"""

import os
import sys
import threading
from collections.abc import Iterator
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pxr import Usd

# More combinations of variants are not looked at.
MAX_COMBINATIONS = 256

# What reading may take beyond what the process has [bytes]: for the library, and for each byte of the file.
HEADROOM, PER_BYTE = 512 << 20, 24
# Seconds of the processor for any file, and the bytes of it that add another.
SECONDS, BYTES_PER_SECOND = 8, 16 << 20
# The stack is half as large as that of most threads: what nests too deeply for one of those is noticed here.
_STACK = 4 << 20

OUT_OF_MEMORY = 3  # the exit code

# A choice: (path of the prim, name of its variant set) -> name of the variant.
Selection = dict[tuple[str, str], str]


def variant_sets(stage: "Usd.Stage") -> dict[tuple[str, str], list[str]]:
    """Return the variants of every set in the current composition, by (prim path, set)."""
    return {
        (str(prim.GetPath()), name): list(prim.GetVariantSet(name).GetVariantNames())
        for prim in stage.TraverseAll()
        for name in prim.GetVariantSets().GetNames()
    }


def select_variant(stage: "Usd.Stage", prim: str, name: str, variant: str) -> None:
    """Choose a variant in the session layer: the file does not change."""
    from pxr import Usd

    with Usd.EditContext(stage, stage.GetSessionLayer()):
        stage.GetPrimAtPath(prim).GetVariantSet(name).SetVariantSelection(variant)


def variant_combinations(
    stage: "Usd.Stage", chosen: Selection | None = None
) -> Iterator[Selection]:
    """Put the stage into every combination of its variants in turn; yield what is chosen.

    A stage without variants is yielded once, with nothing chosen.
    """
    chosen = chosen or {}
    # A selection may add sets: nested ones, or those of a payload.
    for key, variants in variant_sets(stage).items():
        if key not in chosen and variants:
            for variant in variants:
                select_variant(stage, *key, variant)
                yield from variant_combinations(stage, chosen | {key: variant})
            return
    yield chosen


def seconds_for(size: int) -> int:
    """Return what a file of so many bytes may take of the processor [s]."""
    return SECONDS + size // BYTES_PER_SECOND


def _walk(path: str) -> None:
    """Compose all that the file can show, fetch each value, and run OpenUSD's validators."""
    from pxr import Usd, UsdValidation

    stage = Usd.Stage.Open(path)
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    context = UsdValidation.ValidationContext(validators)
    for _ in islice(variant_combinations(stage), MAX_COMBINATIONS):
        for prim in stage.TraverseAll():
            for attribute in prim.GetAttributes():
                for time in attribute.GetTimeSamples() or [Usd.TimeCode.EarliestTime()]:
                    # One value that USD or Python cannot hold; the others may still end the process.
                    with suppress(TypeError, ValueError, RuntimeError):
                        attribute.Get(time)
        context.Validate(stage)


def _limit(size: int) -> None:
    """Limit what this process takes, where the system can."""
    with suppress(ImportError, OSError, ValueError):
        import resource

        used = int(Path("/proc/self/status").read_text().split("VmData:")[1].split()[0]) * 1024
        for kind, most in (
            (resource.RLIMIT_CORE, 0),
            (resource.RLIMIT_CPU, seconds_for(size)),
            (resource.RLIMIT_DATA, used + HEADROOM + PER_BYTE * size),
        ):
            old = [each for each in resource.getrlimit(kind) if each != resource.RLIM_INFINITY]
            resource.setrlimit(kind, (min([most, *old]), resource.getrlimit(kind)[1]))


def _try(path: str) -> None:
    try:
        _walk(path)
    except MemoryError:
        os._exit(OUT_OF_MEMORY)
    except Exception:  # whoever opens it next gets the same, and can say it
        pass
    os._exit(0)  # no destructors: they may stumble over what is broken


if __name__ == "__main__":
    _limit(int(sys.argv[2]))
    threading.stack_size(_STACK)
    threading.Thread(target=_try, args=(sys.argv[1],)).start()
