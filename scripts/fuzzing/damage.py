"""One to three faults in the bytes of a file, as disks, networks, editors and enemies make them."""

import json
import random
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import yaml

from fuzzing.containers import open_container

# What a count, a size or an offset in a binary header becomes.
INTEGERS = (
    *(0, 1, 0x7F, 0xFF, 2**16, 2**31 - 1, 2**31, 2**32 - 1, 2**40),
    *(2**63 - 1, 2**63, 2**64 - 1),
)
FLOATS = (b"\x00\x00\xc0\x7f", b"\x00\x00\x80\x7f", b"\x00\x00\x80\xff", b"\xff\xff\x7f\x7f")
# What a number in a text becomes.
NUMBERS = (
    *b"0 -1 1 2147483648 9223372036854775808 99999999999999999999 1e9 1e308 1e999 -1e999 nan".split(),
    *b"-nan 1e-320 1_0 0x10 ( [ { \" @x@ true / '".split(),
    *(b"9" * 400, b"9" * 5000, b"", b"1 2"),
)
ODD_NAMES = (
    *"../x /etc/passwd . %s%n {0} con ~ $HOME |ls http://localhost/x \\\\host\\x * -x".split(),
    *("", "a" * 300, "a\0b", "\udc80", "ü\u202e", "a\nb"),
)
# Text that takes the place of a value of JSON; json.dumps would not write some of it.
RAW = (
    *'null true [] {} "" 0 -1 1 0.5 -0.0 2147483648 9223372036854775808 1e999 -1e999 NaN'.split(),
    *'Infinity 1e308 -1e308 1e-320 "nan" "1e999" "x" "../x" "/etc/passwd" "%s{0}" "."'.split(),
    *('"a\\u0000b"', '"\\ud800"', "1" + "0" * 400, "1" * 5000, '"' + "x" * 100_000 + '"'),
    *("[[[]]]", "[null]", "[{}]", '[""]', '{"a": 1}', "[1, 2, 3]", "[1e999]", "[[1, 2], [3]]"),
    *("[" * 100_000 + "]" * 100_000, '{"a":' * 100_000 + "1" + "}" * 100_000),
)
NUMBER = re.compile(rb"-?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?")
WORD = re.compile(rb"[A-Za-z_][\w./-]*")
_MARK = re.compile(r'"@raw (\d+)@"')

Fault = Callable[[bytes, random.Random], bytes]


def damaged(data: bytes, name: str, rng: random.Random) -> bytes:
    """Return the content of the file ``name`` with one to three faults.

    Half of the faults in a file that packs or checks its content (ZIP, PNG, ...) are made inside, with the
    checksums right: they would otherwise hide what is behind them.
    """
    container = open_container(name, data, rng)
    if container is not None and rng.random() < 0.6:
        return container.pack(damaged(container.content, container.name, rng))
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        found = damaged_document(data, name, rng) if rng.random() < 0.6 else None
        if found is None:
            found = rng.choice(TEXT_FAULTS if _is_text(data) else BYTE_FAULTS)(data, rng)
        data = found
    return data


def _is_text(data: bytes) -> bool:
    head = data[:4096]
    return b"\0" not in head and sum(byte < 127 for byte in head) > 0.9 * len(head)


def damaged_document(data: bytes, name: str, rng: random.Random) -> bytes | None:
    """Return a JSON, JSON lines or YAML file with one value changed, its syntax kept; None for others."""
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
    """Return the document as JSON, one of its values missing, extreme, nested or of another type."""
    places: list[tuple[tuple[Any, ...], Any]] = [((), document)]
    for path, value in places:
        if isinstance(value, dict | list):
            keys = value if isinstance(value, dict) else range(len(value))
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


def _flip_bits(data: bytes, rng: random.Random) -> bytes:
    out = bytearray(data)
    for _ in range(rng.choice((1, 2, 8, 64))):
        if out:
            out[_place(data, rng)] ^= 1 << rng.randrange(8)
    return bytes(out)


def _truncate(data: bytes, rng: random.Random) -> bytes:
    return data[: rng.randrange(len(data) + 1)]


def _set_integer(data: bytes, rng: random.Random) -> bytes:
    size = rng.choice((1, 2, 4, 8))
    value = (rng.choice(INTEGERS) % 256**size).to_bytes(
        size, rng.choice(("little", "little", "big"))
    )
    at = _place(data, rng)
    return data[:at] + value + data[at + size :]


def _set_float(data: bytes, rng: random.Random) -> bytes:
    at = _place(data, rng) // 4 * 4
    return data[:at] + rng.choice(FLOATS) + data[at + 4 :]


def _delete(data: bytes, rng: random.Random) -> bytes:
    at = _place(data, rng)
    return data[:at] + data[at + rng.choice((1, 4, 64, 1000)) :]


def _copy_over(data: bytes, rng: random.Random) -> bytes:
    source, target, size = _place(data, rng), _place(data, rng), rng.choice((4, 16, 256))
    piece = data[source : source + size]
    return data[:target] + piece + data[target + len(piece) :]


def _repeat(data: bytes, rng: random.Random) -> bytes:
    at, size = _place(data, rng), rng.choice((4, 64, 1000))
    return data[:at] + data[at : at + size] * rng.choice((2, 10, 1000)) + data[at + size :]


def _insert(data: bytes, rng: random.Random) -> bytes:
    at = _place(data, rng)
    return data[:at] + rng.randbytes(rng.choice((1, 4, 64))) + data[at:]


def _replace_number(data: bytes, rng: random.Random) -> bytes:
    return _replace(data, NUMBER, rng.choice(NUMBERS), rng)


def _replace_word(data: bytes, rng: random.Random) -> bytes:
    name = rng.choice(ODD_NAMES).encode(errors="surrogateescape")
    return _replace(data, WORD, rng.choice((name, b"", b"nan", b"null", b"0")), rng)


def _change_line(data: bytes, rng: random.Random) -> bytes:
    lines = data.split(b"\n")
    at, other = rng.randrange(len(lines)), rng.randrange(len(lines))
    lines[at : at + 1] = rng.choice(
        ([], [lines[at]] * 2, [lines[other]], [b""], [lines[at]] * 2000)
    )
    return b"\n".join(lines)


def _nest(data: bytes, rng: random.Random) -> bytes:
    at = _place(data, rng)
    return data[:at] + rng.choice((b"[", b"{", b"(", b"- ", b'{"a":', b'"')) * 100_000 + data[at:]


def _replace(data: bytes, pattern: re.Pattern[bytes], new: bytes, rng: random.Random) -> bytes:
    """Replace one match of ``pattern``; those near the start are replaced more often."""
    found = list(pattern.finditer(data, 0, 1 << 20))
    if not found:
        return _flip_bits(data, rng)
    spot = rng.choice(found[:40] if rng.random() < 0.5 else found)
    return data[: spot.start()] + new + data[spot.end() :]


def _place(data: bytes, rng: random.Random) -> int:
    """Headers and the ends of files, where the tables are, are hit more often than the numbers between."""
    size = len(data)
    if not size:
        return 0
    last = max(0, size - 1 - rng.randrange(1500))
    return rng.choice((rng.randrange(size), rng.randrange(min(size, 256)), last))


BYTE_FAULTS: tuple[Fault, ...] = (
    *(_flip_bits, _truncate, _set_integer, _set_integer, _set_float, _delete, _copy_over, _repeat),
    *(_insert, _replace_number),
)
TEXT_FAULTS: tuple[Fault, ...] = (
    *(_flip_bits, _truncate, _delete, _copy_over, _repeat, _insert, _nest, _change_line),
    *(_replace_word, _replace_number, _replace_number, _replace_number, _replace_number),
)
