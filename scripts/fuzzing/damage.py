"""One to three faults in the bytes of a file, as disks, networks, editors and enemies make them."""

import random
import re
from collections.abc import Callable

from fuzzing.containers import open_container
from fuzzing.documents import damaged_document

# What a count, a size or an offset in a binary header becomes.
INTEGERS = (
    0,
    1,
    0x7F,
    0xFF,
    2**16,
    2**31 - 1,
    2**31,
    2**32 - 1,
    2**40,
    2**63 - 1,
    2**63,
    2**64 - 1,
)
FLOATS = (b"\x00\x00\xc0\x7f", b"\x00\x00\x80\x7f", b"\x00\x00\x80\xff", b"\xff\xff\x7f\x7f")
# What a number in a text becomes.
NUMBERS = (
    *(b"0", b"-1", b"1", b"2147483648", b"9223372036854775808", b"99999999999999999999", b"1e9"),
    *(
        b"1e308",
        b"1e999",
        b"-1e999",
        b"nan",
        b"-nan",
        b"1e-320",
        b"9" * 400,
        b"9" * 5000,
        b"",
        b"1_0",
    ),
    *(b"0x10", b"(", b"[", b"{", b'"', b"@x@", b"true", b"1 2", b"/", b"'"),
)
ODD_NAMES = (
    *(
        "../x",
        "/etc/passwd",
        "",
        ".",
        "a" * 300,
        "%s%n",
        "{0}",
        "a\0b",
        "\udc80",
        "ü\u202e",
        "a\nb",
        "con",
    ),
    *("~", "$HOME", "|ls", "http://localhost/x", "\\\\host\\x", "*", "-x"),
)
NUMBER = re.compile(rb"-?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?")
WORD = re.compile(rb"[A-Za-z_][\w./-]*")

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
        data = (
            rng.choice(TEXT_FAULTS if _is_text(data) else BYTE_FAULTS)(data, rng)
            if found is None
            else found
        )
    return data


def _is_text(data: bytes) -> bool:
    return b"\0" not in data[:4096] and sum(byte < 127 for byte in data[:4096]) > 0.9 * len(
        data[:4096]
    )


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
    *(
        _flip_bits,
        _truncate,
        _delete,
        _copy_over,
        _repeat,
        _insert,
        _nest,
        _change_line,
        _replace_word,
    ),
    *(_replace_number, _replace_number, _replace_number, _replace_number),
)
