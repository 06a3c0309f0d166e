"""Faults in JSON and YAML that keep the syntax: what is missing, extreme, nested, or of another type."""

import json
import random
import re
from pathlib import Path
from typing import Any

import yaml

# Text that takes the place of a value; json.dumps would not write some of it.
RAW = (
    *(
        "null",
        "true",
        "[]",
        "{}",
        '""',
        "0",
        "-1",
        "1",
        "0.5",
        "-0.0",
        "2147483648",
        "9223372036854775808",
    ),
    *(
        "1e999",
        "-1e999",
        "NaN",
        "Infinity",
        "1e308",
        "-1e308",
        "1e-320",
        "1" + "0" * 400,
        "1" * 5000,
    ),
    *(
        '"nan"',
        '"1e999"',
        '"x"',
        '"../x"',
        '"/etc/passwd"',
        '"a\\u0000b"',
        '"\\ud800"',
        '"%s{0}"',
        '"."',
    ),
    *("[[[]]]", "[null]", "[{}]", '[""]', '{"a": 1}', "[1, 2, 3]", "[1e999]", "[[1, 2], [3]]"),
    *(
        "[" * 100_000 + "]" * 100_000,
        '{"a":' * 100_000 + "1" + "}" * 100_000,
        '"' + "x" * 100_000 + '"',
    ),
)
_MARK = re.compile(r'"@raw (\d+)@"')


def damaged_document(data: bytes, name: str, rng: random.Random) -> bytes | None:
    """Return a JSON, JSON lines or YAML file with one value changed; None for other files."""
    suffix = Path(name).suffix.lower()
    try:
        if suffix in (".json", ".gltf"):
            return _changed(json.loads(data), rng).encode()
        if suffix == ".jsonl":
            lines = data.decode().splitlines()
            at = rng.randrange(len(lines))
            lines[at] = _changed(json.loads(lines[at]), rng)
            return ("\n".join(lines) + "\n").encode()
        if suffix in (".yaml", ".yml"):
            return _changed(yaml.safe_load(data), rng).encode()  # JSON is YAML, too
    except (ValueError, RecursionError, IndexError, AttributeError, yaml.YAMLError):
        return None
    return None


def _changed(document: Any, rng: random.Random) -> str:
    """Return the document as JSON, one of its values changed."""
    places = [((), document)]
    for path, value in places:
        keys = (
            value
            if isinstance(value, dict)
            else range(len(value))
            if isinstance(value, list)
            else ()
        )
        places += [((*path, key), value[key]) for key in keys]
    # The shallow values are few, and matter more than each of the many numbers.
    shallow = [place for place in places if len(place[0]) <= 2]
    path = rng.choice(shallow if rng.random() < 0.5 else places)[0]
    root = {"": document}
    parent: Any = root
    key: Any = ""
    for step in path:
        parent, key = parent[key], step
    _change(parent, key, rng)
    text = json.dumps(root[""]) if "" in root else ""
    return _MARK.sub(lambda mark: RAW[int(mark[1])], text)


def _change(parent: Any, key: Any, rng: random.Random) -> None:
    kind = rng.randrange(10)
    if kind == 0:
        del parent[key]
    elif kind == 1 and isinstance(parent[key], str | list):
        parent[key] = parent[key] * rng.choice((2, 1000))
    elif kind == 2 and isinstance(parent[key], int | float):
        parent[key] = parent[key] * rng.choice((-1, 1e3, 1e-3, 1e9, 1e30))
    elif kind == 3:
        parent[key] = rng.choice(([parent[key]], {"a": parent[key]}, str(parent[key])))
    else:
        parent[key] = f"@raw {rng.randrange(len(RAW))}@"
