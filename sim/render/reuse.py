"""Recordings of the same things in the same surround share one renderer, with the light it has measured.

Several walks around an object, or the same walk at rising noise, then prepare it once.
"""

import hashlib
from dataclasses import fields, is_dataclass
from threading import Lock
from typing import Any

import numpy as np

from digs_warp.sim.environment import Environment
from digs_warp.sim.render.raycast import RaycastRenderer
from digs_warp.sim.scene import Scene

# Scenes with larger arrays [bytes] are not kept: the training that follows may want the memory.
LARGEST = 128 << 20

_lock = Lock()
_kept: dict[bytes, RaycastRenderer] = {}  # the last one alone


def renderer_of(scene: Scene, environment: Environment) -> RaycastRenderer:
    """Return a renderer; the last one of this process, if that was of an equal scene and surround."""
    if _size((scene, environment)) > LARGEST:
        return RaycastRenderer(scene, environment)
    digest = hashlib.blake2b()
    _read((scene, environment), digest.update)
    key = digest.digest()
    with _lock:
        if key not in _kept:
            _kept.clear()
            _kept[key] = RaycastRenderer(scene, environment)
        return _kept[key]


def _size(value: Any) -> int:
    """Return how many bytes the arrays of nested dataclasses and tuples have."""
    if isinstance(value, np.ndarray):
        return value.nbytes
    return sum(map(_size, _parts(value)))


def _read(value: Any, update: Any) -> None:
    """Feed everything that tells nested dataclasses and tuples apart to a digest."""
    if isinstance(value, np.ndarray):
        update(f"{value.dtype}{value.shape}".encode())
        update(np.ascontiguousarray(value).data)
        return
    parts = _parts(value)
    update(f"{type(value).__name__}{len(parts)}".encode())
    if not parts:
        update(repr(value).encode())
    for part in parts:
        _read(part, update)


def _parts(value: Any) -> list[Any]:
    """Return what a dataclass or tuple consists of."""
    if is_dataclass(value):
        return [getattr(value, each.name) for each in fields(value)]
    return list(value) if isinstance(value, tuple) else []
