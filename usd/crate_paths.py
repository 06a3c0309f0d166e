"""The table of paths of a crate, checked before the USD library follows it.

The tree of paths is stored in depth-first order, three integers each: which path it is, which token its
last part is (negative for properties), and where the next sibling is: a number of places ahead, 0 for the
next place (no children), -1 for no sibling, -2 for neither. The library follows the jumps without looking
where they lead; one that leads to a place for the second time makes it build paths until the memory is full.
"""

import numpy as np

from digs_warp.usd.crate import COUNT, Bytes, Section, decompressed, read_count

# Integers are stored as differences of 0, 1, 2 or 4 bytes; none stands for the most common difference.
_WIDTHS = np.array([0, 1, 2, 4])
_MAX_INDEX = 2**31


def check_paths(data: Bytes, what: str, start: int, sections: list[Section]) -> None:
    """Check that the paths of a crate, which begins at ``start``, form one tree of tokens it holds.

    Raises:
        ValueError: they do not; says how, of ``what``.
    """
    bodies = {each.name: data[start + each.start :][: each.length] for each in sections}
    if "PATHS" not in bodies or "TOKENS" not in bodies:
        raise ValueError(f"{what} has no table of paths or tokens")
    paths = bodies["PATHS"]
    total, count = read_count(paths, 0, what), read_count(paths, COUNT.size, what)
    tokens = read_count(bodies["TOKENS"], 0, what)
    # All paths are listed but the empty one, where it is used.
    if not count <= total <= count + 1 or total > _MAX_INDEX:
        raise ValueError(f"{what} is said to have {total} paths and lists {count}")
    at = 2 * COUNT.size
    columns = []
    for _ in range(3):
        size = read_count(paths, at, what)
        at += COUNT.size
        columns.append(_integers(paths[at : at + size], count))
        at += size
    indices, names, jumps = columns
    if (np.bincount(_within(indices, total, what)) > 1).any():
        raise ValueError(f"the table of paths of {what} names a path twice")
    _within(np.abs(names[1:]), tokens, what)  # the root has no name
    _check_tree(jumps, what)


def _within(values: np.ndarray, count: int, what: str) -> np.ndarray:
    if len(values) and (values.min() < 0 or values.max() >= count):
        raise ValueError(f"the table of paths of {what} leads out of its tables")
    return values


def _check_tree(jumps: np.ndarray, what: str) -> None:
    """Every place but the first is reached exactly once; all steps lead ahead, so there are no circles."""
    places = np.arange(len(jumps))
    far = jumps > 0
    steps = [places[jumps >= -1] + 1, (places + jumps)[far]]
    reached = np.concatenate(steps)
    if jumps.min(initial=0) < -2 or reached.max(initial=0) >= len(jumps):
        raise ValueError(f"the table of paths of {what} leads out of itself")
    if len(jumps) and (np.bincount(reached, minlength=len(jumps))[1:] != 1).any():
        raise ValueError(f"the table of paths of {what} is no tree")


def _integers(block: bytes, count: int) -> np.ndarray:
    """Return ``count`` compressed integers, int64: the common difference, codes of two bits, differences.

    Raises:
        ValueError: the block does not hold as many.
    """
    codes_size = (2 * count + 7) // 8
    plain = np.frombuffer(decompressed(block, 4 + codes_size + 4 * count), dtype=np.uint8)
    if count and len(plain) < 4 + codes_size:
        raise ValueError("compressed integers are cut off")
    common = plain[:4].view("<i4")
    codes = (plain[4 : 4 + codes_size, None] >> np.array([0, 2, 4, 6], dtype=np.uint8)) & 3
    codes = codes.reshape(-1)[:count]
    ends = np.cumsum(_WIDTHS[codes])
    rest = plain[4 + codes_size :]
    if count and ends[-1] > len(rest):
        raise ValueError("compressed integers are cut off")
    differences = np.zeros(count, dtype=np.int64)
    differences[codes == 0] = common
    for code in (1, 2, 3):
        width = int(_WIDTHS[code])
        own = codes == code
        places = (ends[own] - width)[:, None] + np.arange(width)
        differences[own] = rest[places].view(f"<i{width}").reshape(-1)
    values = np.cumsum(differences)
    return values.astype(np.int32).astype(np.int64)  # sums wrap around, as in the library
