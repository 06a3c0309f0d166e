"""Checks the frame of a USD file before the USD library maps it: impossible sizes, offsets and nesting.

A crate (``.usdc``) begins with a header that points to a table of sections; a package (``.usdz``) ends with a
directory of its members. Both are a few hundred bytes, however large the file is. Text is read once.
"""

import mmap
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from digs_warp.checks import UsdError
from digs_warp.usd.crate import (
    COUNT,
    CRATE_MAGIC,
    decompressed,
    read_count,
    read_sections,
    section_bodies,
)
from digs_warp.usd.nesting import NestingError, check_crate_nesting, check_text, check_tree_depth
from digs_warp.usd.package import LAYER_SUFFIXES, Member, leaves_package, mapped, read_members
from digs_warp.words import quoted

if TYPE_CHECKING:
    from pxr import Sdf

# Integers are stored as differences of 0, 1, 2 or 4 bytes; 0 bytes mean the most common difference.
_WIDTHS = np.array([0, 1, 2, 4])
_MAX_INDEX = 2**31
# Packages in each other; one in another is usual.
_MOST_PACKAGES = 4


def check_structure(path: Path) -> None:
    """Raise a `UsdError` when the frame of a file is broken, or when it is nested too deeply.

    The USD library checks what is inside the sections.
    """
    try:
        with mapped(path) as data:
            if path.suffix.lower() == ".usdz":
                _check_package(data)
            else:
                _check_layer(data, path.name, "the file", 0, len(data))
    except NestingError as error:
        raise UsdError(
            f"USD scene '{path}': {error}; no real scene does this, export it again"
        ) from error
    except ValueError as error:
        raise UsdError(
            f"USD scene '{path}': truncated or not a USD file ({error}). Copy or export it again."
        ) from error


def open_layers(path: Path) -> "list[Sdf.Layer]":
    """Open the layers of a scene, and those it refers to, before they are composed; check each.

    A broken crate may list prims or variants that it does not hold. Composing such a layer, or walking
    through it as validators do, can end the process. Keep the layers while the stage is opened.

    Raises:
        UsdError: a layer lists a child that it does not hold, or one beside ``path`` has a broken frame.
    """
    from pxr import Sdf

    name = os.path.abspath(path)
    waiting = [name]
    if path.suffix.lower() == ".usdz":
        with mapped(path) as data:
            waiting += [f"{name}[{each}]" for each in _layers_of(data)]
    layers: dict[str, Sdf.Layer | None] = {}
    checked = {name}
    while waiting:
        identifier = waiting.pop()
        if identifier in layers:
            continue
        file = _file_of(identifier)
        if file not in checked and os.path.isfile(file):
            check_structure(Path(file))
        checked.add(file)
        layer = layers[identifier] = Sdf.Layer.FindOrOpen(identifier)
        if layer:
            _check_specs(layer, path)
            waiting += [
                Sdf.ComputeAssetPathRelativeToLayer(layer, each)
                for each in layer.GetCompositionAssetDependencies()
            ]
    return [layer for layer in layers.values() if layer]


def _file_of(identifier: str) -> str:
    """Return the file of a layer, which may be in a package, and may have arguments."""
    from pxr import Ar, Sdf

    asset, _ = Sdf.Layer.SplitIdentifier(identifier)
    if Ar.IsPackageRelativePath(asset):
        asset, _ = Ar.SplitPackageRelativePathOuter(asset)
    return str(Ar.GetResolver().Resolve(asset)) or asset


def _check_specs(layer: "Sdf.Layer", path: Path) -> None:
    places: list[Sdf.Path] = []
    layer.Traverse("/", places.append)
    for place in places:
        # Targets of relationships are listed, too, but are not objects.
        if not place.IsTargetPath() and not _is_whole(layer, place):
            raise UsdError(
                f"USD scene '{path}': layer '{layer.GetDisplayName()}' lists {quoted(str(place))}, or a "
                "variant of it, but does not hold it; the file is broken. Copy or export it again."
            )


def _is_whole(layer: "Sdf.Layer", place: "Sdf.Path") -> bool:
    """Whether an object is there, and if it is a set of variants, all of them."""
    from pxr import Sdf

    spec = layer.GetObjectAtPath(place)
    if not isinstance(spec, Sdf.VariantSetSpec):
        return bool(spec)
    owner = place.GetParentPath()
    return all(
        name and layer.GetObjectAtPath(owner.AppendVariantSelection(spec.name, name))
        for name in spec.variants.keys()
    )


def _layers_of(data: mmap.mmap | bytes) -> Iterator[str]:
    """Yield the names of the layers of a package, and as "b.usdz[a.usdc]" of those of packages in it."""
    for member in read_members(data):
        if member.name.lower().endswith(".usdz"):
            yield from (f"{member.name}[{each}]" for each in _layers_of(_bytes_of(data, member)))
        elif member.name.lower().endswith(LAYER_SUFFIXES):
            yield member.name


def _bytes_of(data: mmap.mmap | bytes, member: Member) -> bytes:
    return data[member.start : member.start + member.size]


def _check_package(data: mmap.mmap | bytes, level: int = 1) -> None:
    for member in read_members(data):
        _check_member(data, member, level)


def _check_member(data: mmap.mmap | bytes, member: Member, level: int) -> None:
    if leaves_package(member.name):
        raise ValueError(f"member {quoted(member.name)} leads out of the package")
    if member.encrypted or member.compressed:
        raise ValueError(f"member {quoted(member.name)} is compressed or encrypted")
    if not member.name.lower().endswith(".usdz"):
        _check_layer(data, member.name, member.name, member.start, member.size)
    elif level == _MOST_PACKAGES:
        raise ValueError(f"member {quoted(member.name)} is a package in {level} packages")
    else:
        _check_package(_bytes_of(data, member), level + 1)


def _check_layer(data: mmap.mmap | bytes, name: str, what: str, start: int, size: int) -> None:
    """Check the layer ``name`` in ``data[start : start + size]``; nothing for textures and the like."""
    is_crate = data[start : start + 8] == CRATE_MAGIC
    if is_crate or name.lower().endswith(".usdc"):
        sections = read_sections(data, what, start, size)
        bodies = section_bodies(data, start, sections)
        check_paths(bodies, what)
        check_crate_nesting(data, what, start, size, bodies)
    elif name.lower().endswith(LAYER_SUFFIXES):
        check_text(data[start : start + size], what)


def check_paths(bodies: Mapping[str, bytes], what: str) -> None:
    """Check that the paths of a crate, given by its sections, form one tree of tokens it holds.

    The tree is stored in depth-first order, three integers for each path: its number, the token of its last
    part (negative for properties), and where its next sibling is: a number of places ahead, 0 for the next
    place (no children), -1 for no sibling, -2 for neither. The library follows these jumps without a check;
    if one leads to a place for the second time, it builds paths until the memory is full.

    Raises:
        ValueError: they do not; says how, of ``what``.
    """
    if "PATHS" not in bodies or "TOKENS" not in bodies:
        raise ValueError(f"{what} has no table of paths or tokens")
    paths = bodies["PATHS"]
    total, count = read_count(paths, 0, what), read_count(paths, COUNT.size, what)
    tokens = read_count(bodies["TOKENS"], 0, what)
    # All paths are listed but the empty one, where it is used.
    if not count <= total <= count + 1 or total > _MAX_INDEX:
        raise ValueError(f"{what} claims {total} paths but lists {count}")
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
    check_tree_depth(jumps, what)


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
        ValueError: the block holds fewer.
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
