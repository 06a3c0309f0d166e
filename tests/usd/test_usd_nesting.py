"""Files that nest deeper than the USD library's stack: refused, whole processes long."""

import zipfile
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import UsdError
from digs_warp.usd import nesting
from digs_warp.usd.nesting import check_tree_depth
from digs_warp.usd.structure import check_structure
from reference.usd_files import run_fresh

HEAD = "#usda 1.0\n"
DEPTH = 200_000

# Each ended the process with a fault in the USD library.
TEXTS = {
    "lists": HEAD + 'def "A" { int[] x = ' + "[" * DEPTH,
    "dictionaries": HEAD + "(\ncustomLayerData = {\n" + "dictionary a = {\n" * DEPTH,
    "tuples": HEAD + 'def "A" { float3 x = ' + "(" * DEPTH,
    "prims": HEAD + 'def "A" {\n' * DEPTH,
    "path": HEAD + 'def "A" (inherits = <' + "/a" * DEPTH + ">) {}",
    "target": HEAD + 'def "A" {\nrel x = </A.r' + "[/A.r" * DEPTH + "]" * DEPTH + ">\n}",
    "expression": HEAD + 'def "A" (references = @`' + "if(" * DEPTH + "`@) {}",
    "path expression": HEAD + 'def "A" {\npathExpression x = "' + "(" * DEPTH + '"\n}',
    "asset": HEAD + 'def "A" {\nasset x = @' + "a.usdz[" * DEPTH + "]" * DEPTH + "@\n}",
}

READ = """
import sys
from pathlib import Path
from digs_warp.checks import UsdError
from digs_warp.usd.reader import read_gaussians
from digs_warp.usd.validate import validate
for path in map(Path, sys.argv[1:]):
    for read in (read_gaussians, validate):
        try:
            read(path)
        except UsdError as error:
            print(str(error))
"""


def refusals(*paths: Path) -> list[str]:
    """The errors of reading and of validating each file, in a process that a fault would end."""
    return run_fresh(READ, *paths).stdout.splitlines()


def test_deep_text_is_refused_before_the_library_reads_it(tmp_path: Path):
    paths = []
    for name, text in TEXTS.items():
        paths.append(tmp_path / f"{name}.usda")
        paths[-1].write_text(text)
    (tmp_path / "text.usd").write_text(TEXTS["lists"])
    with zipfile.ZipFile(tmp_path / "package.usdz", "w") as package:
        package.writestr("default.usda", TEXTS["dictionaries"])
    (tmp_path / "outer.usda").write_text(HEAD + "(\nsubLayers = [@inner.usda@]\n)\n")
    (tmp_path / "inner.usda").write_text(HEAD + 'def "A" (references = @tuples.usda@) {\n}\n')
    paths += [tmp_path / name for name in ("text.usd", "package.usdz", "outer.usda")]
    lines = refusals(*paths)
    assert len(lines) == 2 * len(paths)
    assert all("expected up to 256" in line for line in lines)
    assert "tuples.usda" in lines[-1]  # the file at fault, not the one that refers to it


def test_a_crate_of_deep_dictionaries_prims_or_expressions_is_refused(tmp_path: Path):
    # The library writes what it then fails to read: with ten thousand levels in a small thread.
    depth = 300
    texts = {
        "dictionaries": "(\ncustomLayerData = {\n"
        + "dictionary a = {\n" * depth
        + "}\n" * depth
        + "}\n)",
        "prims": 'def "A" {\n' * depth + "}\n" * depth,
        "a string": 'def "A" {\nasset x = @' + "a.usdz[" * depth + "]" * depth + "@\n}",
    }
    from pxr import Sdf

    for name, text in texts.items():
        layer = Sdf.Layer.CreateAnonymous(".usda")
        assert layer.ImportFromString(HEAD + text)
        path = tmp_path / f"{name}.usdc"
        layer.Export(str(path))
        with pytest.raises(
            UsdError, match=rf"{name} nested \d+ deep in the file, expected up to 256"
        ):
            check_structure(path)


def test_brackets_in_comments_and_pieces_of_text_do_not_add_up():
    many = b"([{" * 100
    text = b"#usda 1.0\n# " + many + many + b"\n/* " + many + many + b" */\n// " + many + b"\n"
    text += (b'string a = "' + b"(" * 200 + b'"\n') * 9 + b"asset b = @" + b"(" * 200 + b"@\n"
    text += b"rel c = <" + b"/a" * 200 + b">\n" + b'string d = """' + b"{\n" * 200 + b'"""\n'
    text += b"[(0, 1)] " * 100_000
    nesting.check_text(text, "it")


def test_no_piece_of_text_hides_the_depth_of_the_rest() -> None:
    for text in [b'"]" [', b"'\\']' [", b"# ]\n[", b"/* ] */ [", b"@]@ [", b"] ["]:
        nesting.check_text(text * nesting.MAX_NESTING, "it")
        if text != b"] [":  # closing what was never opened is an error of the library
            with pytest.raises(ValueError, match="brackets nested 257 deep in it"):
                nesting.check_text(text * (nesting.MAX_NESTING + 1), "it")


def test_pieces_without_an_end_take_no_longer_than_their_length() -> None:
    for piece in [b'"', b'\\"', b"'''", b'"""', b"/*", b"@@@", b"<", b"@", b"/"]:
        nesting.check_text(piece * 300_000, "it")


def test_the_depth_of_a_tree_of_paths_counts_ancestors_only():
    # The root, a child with two children, and its sibling with one child.
    check_tree_depth(np.array([-1, 3, 0, -2, -1, -2]), "it")
    with pytest.raises(ValueError, match="prims nested 299 deep"):
        check_tree_depth(np.array([-1] * 299 + [-2]), "it")
    check_tree_depth(np.array([-1] + [2, -2] * 10_000 + [-2]), "it")
