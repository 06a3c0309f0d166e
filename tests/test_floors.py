"""Floors: a file imports only from lower ones, never sideways (docs/design/0001-packages-and-floors.md)."""

import ast
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parent.parent
# Folder -> the package that it is imported as.
FOLDERS = {"digs_warp": "digs_warp", "sim": "digs_warp.sim", "usd": "digs_warp.usd"}

# The longest entry that is a prefix of a module's name is its room, the number its floor.
FLOORS = {
    f"digs_warp.{room}": floor
    for floor, rooms in enumerate(
        (
            ("geometry", "checks", "bounds", "settings", "words", "record"),
            ("data", "device"),
            ("measure", "engines"),
            ("init", "splat", "poses", "masks", "losses", "sim", "usd"),
            ("train", "surface", "show.film", "torch", "formats", "check"),
            ("pipeline",),
            ("show.report",),
            ("api", "cli", "__main__", "commands", "study", "show.view", "show"),
        )
    )
    for room in rooms
}
# The lowest floor is one room: the vocabulary and the record of a run.
SHARED_FLOORS = (0,)
TOP_FLOOR = 7  # may see everything


def module_files() -> dict[str, Path]:
    """All modules by the dotted name that they are imported as."""
    return {
        ".".join([package, *path.relative_to(REPOSITORY / folder).with_suffix("").parts]): path
        for folder, package in FOLDERS.items()
        for path in (REPOSITORY / folder).rglob("*.py")
    }


def room_of(module: str) -> str | None:
    """The longest prefix of ``module`` in the table."""
    parts = module.split(".")
    prefixes = (".".join(parts[:length]) for length in range(len(parts), 0, -1))
    return next((prefix for prefix in prefixes if prefix in FLOORS), None)


def imported_names(source: str) -> set[str]:
    """Everything that ``source`` imports, also inside functions, as dotted names."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"line {node.lineno}: relative import"
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return {name for name in names if name.split(".")[0] == "digs_warp"}


def violations(module: str, source: str) -> list[str]:
    """What ``module`` imports from its own floor's siblings or from above."""
    room = room_of(module)
    if room is None or FLOORS[room] == TOP_FLOOR:
        return []
    floor = FLOORS[room]
    found = []
    for name in sorted(imported_names(source)):
        target = room_of(name)
        if target is None or target == room:  # None: the package itself, such as its version
            continue
        sideways = FLOORS[target] == floor and floor not in SHARED_FLOORS
        if FLOORS[target] > floor or sideways:
            found.append(f"{module} (floor {floor}) imports {name} (floor {FLOORS[target]})")
    return found


def test_every_file_imports_only_from_lower_floors() -> None:
    found = [
        line
        for module, path in module_files().items()
        for line in violations(module, path.read_text(encoding="utf-8"))
    ]
    assert found == []


def test_every_file_has_a_floor() -> None:
    homeless = [
        m
        for m in module_files()
        if room_of(m.removesuffix(".__init__")) is None and m.count(".") < 2
    ]
    assert homeless == ["digs_warp.__init__"], "give the new file a floor in FLOORS"


def test_the_rule_itself() -> None:
    for module, source, allowed in [
        ("digs_warp.geometry.camera", "from digs_warp.geometry.rigid import rigid", True),
        ("digs_warp.geometry.camera", "import digs_warp.data.capture", False),
        ("digs_warp.splat.render", "from digs_warp import __version__", True),
        ("digs_warp.splat.render", "from digs_warp.splat.project import project", True),
        ("digs_warp.splat.render", "from digs_warp.init import recipes", False),
        ("digs_warp.splat.render", "def f():\n    from digs_warp.sim import scene", False),
        ("digs_warp.sim.record.record", "from digs_warp.usd.writer import write_gaussians", False),
        ("digs_warp.pipeline.reconstruct", "import digs_warp.show.report", False),
        ("digs_warp.pipeline.reconstruct", "import digs_warp.train.trainer", True),
        ("digs_warp.train.trainer", "from digs_warp.pipeline import reconstruct", False),
        (
            "digs_warp.commands.run",
            "import digs_warp.cli, digs_warp.sim.record.record, digs_warp.usd.writer",
            True,
        ),
    ]:
        assert (violations(module, source) == []) == allowed, source
