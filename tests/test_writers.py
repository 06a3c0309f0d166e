"""Every write of the package goes through digs_warp.record.files, which checks and syncs it."""

import ast
from collections.abc import Iterator
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parent.parent
FOLDERS = ("digs_warp", "sim", "usd", "scripts", "studies")

# Functions and methods that make, change or move files.
WRITERS = {
    *("write_text", "write_bytes", "touch", "symlink_to", "hardlink_to", "tofile"),
    *("savez", "savez_compressed", "savetxt", "imwrite", "mimsave", "imsave", "VideoWriter"),
    *("copyfile", "copyfileobj", "copytree", "copy2", "move", "rename", "renames", "make_archive"),
    *("Export", "CreateNew", "Save", "mkstemp", "NamedTemporaryFile", "truncate"),
    *("write_point_cloud", "write_triangle_mesh", "write_binary", "write_text_file", "pwrite"),
}
# Names that mean a write only for these modules: `str.replace`, `Image.save` and `dict.copy` are others.
OF_MODULES = {
    "replace": ("os",), "copy": ("shutil",), "save": ("np", "numpy", "torch"), "dump": ("json", "pickle"),
    "link": ("os",), "symlink": ("os",), "write": ("models[0]", "model"), "write_image": ("target",),
}  # fmt: skip

# Where a file may be written otherwise: file, what, why.
ALLOWED = {
    ("digs_warp/record/disk.py", "*"): "this is where everything is checked and synced",
    ("digs_warp/record/arrays.py", "savez"): "into memory",
    ("digs_warp/data/images.py", "open ?"): "into memory, checked",
    ("digs_warp/record/files.py", "rename"): "of record/disk.py",
    ("digs_warp/data/images.py", "write_image"): "into memory, checked",
    ("digs_warp/show/film/video.py", "open ?"): "in memory",
    ("digs_warp/formats/splats/sog.py", "ZipFile"): "read, or in memory",
    ("digs_warp/cli.py", "open w"): "the null device, for a closed stream",
    ("digs_warp/commands/precompile.py", "touch"): "an empty mark in the cache of kernels",
    ("usd/files.py", "Export"): "below a temporary name; OpenUSD reports failed writes",
    ("usd/capture_scene.py", "CreateNew"): "below a temporary name; OpenUSD reports failed writes",
    ("usd/capture_scene.py", "Save"): "below a temporary name; OpenUSD reports failed writes",
    ("usd/files.py", "ZipFile"): "below a temporary name",
    ("usd/files.py", "copyfileobj"): "below a temporary name",
    ("digs_warp/poses/from_images/workspace.py", "write"): "below a temporary name, read back",
    ("digs_warp/formats/captures/colmap.py", "write_text"): "of pycolmap: read back",
    ("digs_warp/formats/captures/training_sets.py", "open ?"): "tarfile reports failed writes",
    ("digs_warp/record/replacement.py", "replace"): "files that are synced, in a noted order",
    ("sim/testing/series.py", "rename"): "of record/disk.py: a folder whose files are synced",
    ("studies/real_recordings.py", "symlink_to"): "in a temporary folder",
    ("digs_warp/study/engine/chain.py", "rename"): "a folder of files that are synced",
}


def writes(source: str) -> Iterator[tuple[int, str]]:
    """Yield line and name of every call in ``source`` that writes a file."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Call):
            name, owner = _called(node.func)
            if name == "open":
                mode = _mode(node, owner)
                if set(mode) & set("wax+?"):
                    yield node.lineno, f"open {mode}"
            elif name in WRITERS or owner in OF_MODULES.get(name, ()):
                yield node.lineno, name
            elif name == "ZipFile" and len(node.args) + len(node.keywords) > 1:
                yield node.lineno, name
            elif name == "savefig" and not _is_memory(node):
                yield node.lineno, name
            elif name == "replace" and len(node.args) == 1 and not node.keywords and owner:
                yield node.lineno, "Path.replace"


def _called(function: ast.expr) -> tuple[str, str]:
    if isinstance(function, ast.Attribute):
        return function.attr, ast.unparse(function.value)
    return (function.id, "") if isinstance(function, ast.Name) else ("", "")


def _mode(call: ast.Call, owner: str) -> str:
    """The mode of `open(path, mode)` or `path.open(mode)`; "?" where the code decides it."""
    if owner in ("os", "oiio", "webbrowser", "archive") or owner.endswith(
        ("Stage", "Input", "Database", "Image")
    ):
        return "r"
    place = 0 if owner else 1
    modes = [k.value for k in call.keywords if k.arg == "mode"] + call.args[place : place + 1]
    if not modes:
        return "r"
    return str(modes[0].value) if isinstance(modes[0], ast.Constant) else "?"


def _is_memory(call: ast.Call) -> bool:
    return bool(call.args) and ast.unparse(call.args[0]) in ("data", "buffer", "file")


def violations(name: str, source: str) -> list[str]:
    """Writes in the file ``name`` that are not in the list."""
    return [
        f"{name}:{line}: {what}; use digs_warp.record.files"
        for line, what in writes(source)
        if (name, what) not in ALLOWED and (name, "*") not in ALLOWED
    ]


def sources() -> list[Path]:
    return sorted(
        path
        for folder in FOLDERS
        for path in (REPOSITORY / folder).rglob("*.py")
        # What others write; inputs that are damaged.
        if not {"peers", "fuzzing"} & set(path.parts)
    )


def test_files_are_written_in_one_place() -> None:
    files = {str(path.relative_to(REPOSITORY)): path for path in sources()}
    assert [
        found
        for name, path in files.items()
        for found in violations(name, path.read_text(encoding="utf-8"))
    ] == []


def test_every_exception_is_needed_and_seen() -> None:
    for name, what in ALLOWED:
        found = {what for _, what in writes((REPOSITORY / name).read_text(encoding="utf-8"))}
        assert found and (what == "*" or what in found), (name, what, found)


def test_other_calls_of_the_same_names_write_nothing() -> None:
    for source in ("open(path)", "ZipFile(path)", "text.replace('a', 'b')", "replace(config)"):
        assert violations("digs_warp/x.py", source) == [], source
    for source in ("open(path, 'w')", "path.open('x')", "np.save(path, array)", "a.replace(b)"):
        assert violations("digs_warp/x.py", source) != [], source
