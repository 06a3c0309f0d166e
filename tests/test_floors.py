"""Floors: a file imports only from lower ones, never sideways (docs/design/0001-packages-and-floors.md)."""

import ast
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parent.parent
# Folder -> the package that it is imported as.
FOLDERS = {"digs_warp": "digs_warp", "sim": "digs_warp.sim", "usd": "digs_warp.usd"}

# The longest entry that is a prefix of a module's name is its room, the number its floor.
FLOORS = {
    **dict.fromkeys(
        (
            "digs_warp.geometry",
            "digs_warp.camera",
            "digs_warp.sh",
            "digs_warp.checks",
            "digs_warp.bounds",
            "digs_warp.words",
        ),
        0,
    ),
    "digs_warp.record": 0,
    **dict.fromkeys(("digs_warp.data", "digs_warp.device"), 1),
    **dict.fromkeys(("digs_warp.measure", "digs_warp.plausibility", "digs_warp.engines"), 2),
    **dict.fromkeys(("digs_warp.init", "digs_warp.splat", "digs_warp.sfm", "digs_warp.segment"), 3),
    "digs_warp.poses": 3,
    **dict.fromkeys(("digs_warp.losses", "digs_warp.sim", "digs_warp.usd"), 3),
    **dict.fromkeys(
        ("digs_warp.train", "digs_warp.surface", "digs_warp.film", "digs_warp.torch"), 4
    ),
    "digs_warp.interchange": 4,
    "digs_warp.pipeline": 5,
    "digs_warp.report": 6,
    **dict.fromkeys(
        (
            "digs_warp.api",
            "digs_warp.cli",
            "digs_warp.__main__",
            "digs_warp.commands",
            "digs_warp.study",
            "digs_warp.view",
        ),
        7,
    ),
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


@pytest.mark.parametrize("module", sorted(module_files()))
def test_every_file_imports_only_from_lower_floors(module: str) -> None:
    assert violations(module, module_files()[module].read_text(encoding="utf-8")) == []


def test_every_file_has_a_floor() -> None:
    homeless = [
        m
        for m in module_files()
        if room_of(m.removesuffix(".__init__")) is None and m.count(".") < 2
    ]
    assert homeless == ["digs_warp.__init__"], "give the new file a floor in FLOORS"


@pytest.mark.parametrize(
    ("module", "source", "allowed"),
    [
        ("digs_warp.camera", "from digs_warp.geometry import rigid", True),
        ("digs_warp.camera", "import digs_warp.data.capture", False),
        ("digs_warp.splat.render", "from digs_warp import __version__", True),
        ("digs_warp.splat.render", "from digs_warp.splat.project import project", True),
        ("digs_warp.splat.render", "from digs_warp.init import recipes", False),
        ("digs_warp.splat.render", "def f():\n    from digs_warp.sim import scene", False),
        ("digs_warp.sim.record", "from digs_warp.usd.writer import write_gaussians", False),
        ("digs_warp.pipeline.reconstruct", "import digs_warp.report", False),
        ("digs_warp.pipeline.reconstruct", "import digs_warp.train.trainer", True),
        ("digs_warp.train.trainer", "from digs_warp.pipeline import reconstruct", False),
        (
            "digs_warp.commands.run",
            "import digs_warp.cli, digs_warp.sim.record, digs_warp.usd.writer",
            True,
        ),
    ],
)
def test_the_rule_itself(module: str, source: str, allowed: bool) -> None:
    assert (violations(module, source) == []) == allowed
