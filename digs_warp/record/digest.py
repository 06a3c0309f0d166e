"""Short names for settings: equal settings have equal names."""

import hashlib
import json
from typing import Any

from digs_warp.record.files import to_json


def plain(value: Any) -> Any:
    """Return a value of dataclasses, paths and NumPy scalars as JSON stores it."""
    return json.loads(to_json(value))


def digest(value: Any) -> str:
    """Return 16 hexadecimal digits that identify a JSON-like value; the order of keys does not matter."""
    text = json.dumps(plain(value), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]
