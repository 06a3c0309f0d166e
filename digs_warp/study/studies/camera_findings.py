"""What the study of the camera says in words: what the defaults make worse, and what was measured earlier."""

from collections.abc import Mapping, Sequence
from statistics import median

from digs_warp.study.engine.records import Record, Value, final_psnr, number, placed_psnr
from digs_warp.study.studies.held_surface import ACCURACY

# Two records of the same recording: without and with something.
Pair = tuple[Record, Record]

# Losses below these are not named: another order of the views changes as much.
NAMED_DB, NAMED_SHARE = 0.1, 1.05


_in_place = number("surface", "accuracy_in_place", factor=1e3)


def placed_accuracy(record: Record) -> float | None:
    """Return the distance of the surface in its place to the true one [mm]; of earlier records as it lies."""
    found = _in_place(record)
    return ACCURACY(record) if found is None else found


def differences(pairs: Sequence[Pair], value: Value) -> list[float]:
    """Return the second of each pair minus the first, where both were measured."""
    known = [(value(one), value(other)) for one, other in pairs]
    return [b - a for a, b in known if a is not None and b is not None]


def made_worse(pairs: Mapping[tuple[str, str], Sequence[Pair]]) -> str:
    """Name what the defaults make worse."""
    images, surfaces = [], []
    for (source, name), found in pairs.items():
        gains = differences(found, final_psnr)
        if gains and median(gains) < -NAMED_DB:
            images.append(f"{name}, {source} ({median(gains):+.2f} dB)")
        known = [(placed_accuracy(one), placed_accuracy(other)) for one, other in found]
        shares = [b / a for a, b in known if a and b]
        if shares and median(shares) > NAMED_SHARE:
            surfaces.append(f"{name}, {source} ({median(shares):.2f} times as far)")
    sentences = [
        f"{what} the defaults make worse: {'; '.join(names) or 'none'}."
        for what, names in (("Images that", images), ("Surfaces that", surfaces))
    ]
    return " ".join(sentences)


def measured_earlier(records: Sequence[Record]) -> str:
    """Say which records are of an earlier version."""
    sources = {
        r["labels"]["source"] for r in records if r.get("yardstick") and placed_psnr(r) is None
    }
    if not sources:
        return ""
    named = ", ".join(sorted(sources))
    return f" These were measured earlier, as they lie and with brightness fitted to each view: {named}."
