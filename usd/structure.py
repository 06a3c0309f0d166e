"""Looks at the frame of a USD file before the USD library maps it: sizes and offsets that cannot be.

A crate (``.usdc``) begins with a header that points to a table of sections; a package (``.usdz``) ends with a
directory of its members. Both are a few hundred bytes, whatever the size of the file.
"""

import mmap
import os
from pathlib import Path
from typing import TYPE_CHECKING

from digs_warp.checks import UsdError
from digs_warp.usd.crate import CRATE_MAGIC, read_sections
from digs_warp.usd.crate_paths import check_paths
from digs_warp.usd.package import LAYER_SUFFIXES, Member, leaves_package, mapped, read_members

if TYPE_CHECKING:
    from pxr import Sdf


def check_structure(path: Path) -> None:
    """Raise a `UsdError` when the header or the directory of a ``.usdc`` or ``.usdz`` file is broken.

    Text files have no frame. What lies inside the sections is left to the USD library.
    """
    suffix = path.suffix.lower()
    try:
        with mapped(path) as data:
            if suffix == ".usdz":
                for member in read_members(data):
                    _check_member(data, member)
            elif suffix == ".usdc" or (suffix == ".usd" and data[:8] == CRATE_MAGIC):
                _check_crate(data, "the file", 0, len(data))
    except ValueError as error:
        raise UsdError(
            f"USD scene '{path}': truncated or not a USD file ({error}). Copy or export it again."
        ) from error


def open_layers(path: Path) -> "list[Sdf.Layer]":
    """Open the layers of a scene, before they are composed, and look whether each is whole.

    A broken crate may list prims or variants that it does not hold. Composing such a layer, or walking
    through it as validators do, can end the process. Keep the layers while the stage is opened.

    Raises:
        UsdError: a layer lists a child that it does not hold.
    """
    from pxr import Sdf

    name = os.path.abspath(path)
    names = [name]
    if path.suffix.lower() == ".usdz":
        with mapped(path) as data:
            members = [member.name for member in read_members(data)]
        names += [f"{name}[{each}]" for each in members if each.lower().endswith(LAYER_SUFFIXES)]
    layers = [Sdf.Layer.FindOrOpen(each) for each in names]
    for layer in layers:
        if layer:
            _check_specs(layer, path)
    return layers


def _check_specs(layer: "Sdf.Layer", path: Path) -> None:
    places: list[Sdf.Path] = []
    layer.Traverse("/", places.append)
    for place in places:
        # Targets of relationships are listed, too, but are no objects of their own.
        if not place.IsTargetPath() and not _is_whole(layer, place):
            raise UsdError(
                f"USD scene '{path}': layer '{layer.GetDisplayName()}' lists '{place}', or a variant in it, "
                "but does not hold it; the file is broken. Copy or export it again."
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


def _check_member(data: mmap.mmap, member: Member) -> None:
    if leaves_package(member.name):
        raise ValueError(f"member '{member.name}' leads out of the package")
    if member.encrypted or member.compressed:
        raise ValueError(f"member '{member.name}' is compressed or encrypted")
    is_crate = data[member.start : member.start + 8] == CRATE_MAGIC
    if is_crate or member.name.lower().endswith(".usdc"):
        _check_crate(data, member.name, member.start, member.size)


def _check_crate(data: mmap.mmap, what: str, start: int, size: int) -> None:
    check_paths(data, what, start, read_sections(data, what, start, size))
