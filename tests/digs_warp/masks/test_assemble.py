"""A network file from its parts: their order, their sums, and what is refused."""

import hashlib
import json
from pathlib import Path

import pytest

from digs_warp.cli import EXIT_BAD_INPUT, EXIT_OK, main
from reference.tiny_network import write_network


@pytest.fixture(scope="module")
def network(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    return write_network(tmp_path_factory.mktemp("net") / "net.onnx").read_bytes()


def named_by_sums(data: bytes, folder: Path) -> list[Path]:
    """Three parts as a package has them, and the index."""
    third = len(data) // 3
    chunks = [data[:third], data[third : 2 * third], data[2 * third :]]
    parts = [folder / hashlib.sha256(chunk).hexdigest() for chunk in chunks]
    for part, chunk in zip(parts, chunks, strict=True):
        part.write_bytes(chunk)
    entry = {"chunks": [{"hash": part.name} for part in parts], "size": len(data)}
    other = {"chunks": [{"hash": "0" * 64}], "size": 7}
    index = folder / "resources.json"
    index.write_text(json.dumps({"/models/small": other, "/models/medium": entry}))
    return [*parts, index]


def test_parts_in_any_order_make_the_file(
    network: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = named_by_sums(network, tmp_path)
    out = tmp_path / "isnet.onnx"
    assert main(["masks", "assemble", *map(str, files[::-1]), "--out", str(out)]) == EXIT_OK
    assert out.read_bytes() == network
    printed = capsys.readouterr().out
    assert hashlib.sha256(network).hexdigest() in printed
    assert "checked by the sums in the names of its parts" in printed
    assert "may you?" in printed and "ships no weights" in printed


def test_without_an_index_the_order_is_that_of_the_command(
    network: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    monkeypatch.setenv("U2NET_HOME", str(tmp_path / "home"))
    halves = [tmp_path / "a", tmp_path / "b"]
    for half, data in zip(halves, (network[:100], network[100:]), strict=True):
        half.write_bytes(data)
    files = list(map(str, halves))
    assert main(["masks", "assemble", *files[::-1]]) == EXIT_BAD_INPUT
    assert "not a network" in capsys.readouterr().err
    wrong = ["--sha256", "1" * 64]
    assert main(["masks", "assemble", *files, *wrong]) == EXIT_BAD_INPUT
    assert "expected 1111" in capsys.readouterr().err
    assert not (tmp_path / "home").exists()
    assert main(["masks", "assemble", *files]) == EXIT_OK
    assert (tmp_path / "home/isnet-general-use.onnx").read_bytes() == network
    assert "checked by nothing" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("damaged", "its SHA-256 is not its name"),
        ("missing", "1 are missing, the first is"),
        ("no file", "no such file"),
        ("no parts", "expected parts and at most one index"),
    ],
)
def test_parts_that_do_not_make_a_network_are_refused(
    network: bytes, tmp_path: Path, fault: str, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    files = named_by_sums(network, tmp_path)
    if fault == "damaged":
        files[1].write_bytes(b"x" + files[1].read_bytes()[1:])
    elif fault == "missing":
        del files[1]
    elif fault == "no file":
        files[0] = tmp_path / "nowhere"
    else:
        files = files[-1:]
    out = tmp_path / "isnet.onnx"
    assert main(["masks", "assemble", *map(str, files), "--out", str(out)]) == EXIT_BAD_INPUT
    assert message in capsys.readouterr().err
    assert not out.exists()
