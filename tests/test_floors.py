"""What keeps the house light: floors, no circles, no crumbs, a line budget for each room.

docs/design/0001-packages-and-floors.md says why.
"""

import ast
from collections import defaultdict
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

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
# The most lines of a room. A change that needs more says in its message what the weight buys.
LINE_BUDGETS = {
    "api": 391,
    "check": 1_692,
    "commands": 2_970,
    "data": 3_143,
    "device": 864,
    "engines": 976,
    "files at the top": 744,
    "formats": 5_655,
    "geometry": 630,
    "init": 3_555,
    "losses": 626,
    "masks": 625,
    "measure": 1_508,
    "pipeline": 2_261,
    "poses": 4_446,
    "record": 1_851,
    "show": 2_810,
    "sim.camera": 1_350,
    "sim.fit": 1_609,
    "sim.record": 1_955,
    "sim.render": 4_260,
    "sim.scene": 3_552,
    "sim.sensor": 4_367,
    "sim.testing": 851,
    "splat": 4_142,
    "study": 1_480,
    "surface": 561,
    "torch": 180,
    "train": 3_580,
    "usd": 2_348,
}
MOST_FILES = 470  # of the product; 65,000 lines in 500 files are the goal
# A shorter file with a single client in its folder belongs into that client.
CRUMB = 60

# The lowest floor is one room: the vocabulary and the record of a run.
SHARED_FLOORS = (0,)
TOP_FLOOR = 7  # may see everything


@cache
def module_files() -> dict[str, Path]:
    """All modules by the dotted name that they are imported as."""
    return {
        ".".join([package, *path.relative_to(REPOSITORY / folder).with_suffix("").parts]): path
        for folder, package in FOLDERS.items()
        for path in sorted((REPOSITORY / folder).rglob("*.py"))
    }


@cache
def sources() -> dict[str, str]:
    """The text of every module."""
    return {module: path.read_text(encoding="utf-8") for module, path in module_files().items()}


def room_of(module: str) -> str | None:
    """The longest prefix of ``module`` in the table."""
    parts = module.split(".")
    prefixes = (".".join(parts[:length]) for length in range(len(parts), 0, -1))
    return next((prefix for prefix in prefixes if prefix in FLOORS), None)


def imported_names(source: str, types: bool = True) -> set[str]:
    """Everything that ``source`` imports, also inside functions, as dotted names; with what is for types."""
    tree = ast.parse(source)
    for node in () if types else ast.walk(tree):
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            node.body = []
    names: set[str] = set()
    for node in ast.walk(tree):
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
    assert [line for each in sources().items() for line in violations(*each)] == []


def test_every_file_has_a_floor() -> None:
    homeless = [
        m
        for m in module_files()
        if room_of(m.removesuffix(".__init__")) is None and m.count(".") < 2
    ]
    assert homeless == ["digs_warp.__init__"], "give the new file a floor in FLOORS"


def module_graph(texts: dict[str, str]) -> dict[str, set[str]]:
    """Each module with the modules that it imports."""
    names = {module.removesuffix(".__init__"): module for module in texts}

    def target(name: str) -> str | None:
        return names.get(name) or names.get(name.rpartition(".")[0])

    return {
        module: {found for name in imported_names(text, types=False) if (found := target(name))}
        - {module}
        for module, text in texts.items()
    }


def crumbs(texts: dict[str, str]) -> list[str]:
    """Short files that one file of their folder imports, and nobody else."""
    clients = defaultdict[str, set[str]](set)
    for module, imported in module_graph(texts).items():
        for name in imported:
            clients[name].add(module)
    return [
        f"{module} ({len(text.splitlines())} lines) belongs into {client}"
        for module, text in texts.items()
        if len(text.splitlines()) < CRUMB and len(clients[module]) == 1
        for client in clients[module]
        if client.rpartition(".")[0] == module.rpartition(".")[0]
        and not module.endswith("__init__")
        and not client.endswith("__init__")  # a registry: an effect is a file of its own
        and not module.endswith("_kernel")  # device code, which pyright leaves out file by file
    ]


def test_no_files_import_each_other_in_a_circle() -> None:
    try:
        TopologicalSorter(module_graph(sources())).prepare()
    except CycleError as error:
        pytest.fail(" -> ".join(error.args[1]))


def test_no_short_file_has_a_single_client_in_its_folder() -> None:
    assert crumbs(sources()) == []


def test_every_room_keeps_to_its_line_budget() -> None:
    lines = defaultdict[str, int](int)
    for module, text in sources().items():
        lines[budget_of(module)] += len(text.splitlines())
    over = {room: n for room, n in lines.items() if n > LINE_BUDGETS[room]}
    assert over == {}, f"more than LINE_BUDGETS: {over}"
    assert len(sources()) <= MOST_FILES


def budget_of(module: str) -> str:
    """The folder of a module, two levels deep in sim/."""
    parts = module.split(".")
    depth = 3 if parts[1] == "sim" else 2
    return ".".join(parts[1:depth]) if len(parts) > depth else "files at the top"


def test_the_rules_on_circles_and_short_files() -> None:
    one = {
        "digs_warp.a.b": "from digs_warp.a.c import d",
        "digs_warp.a.c": "def d():\n    import digs_warp.a.b",
    }
    with pytest.raises(CycleError):
        TopologicalSorter(module_graph(one)).prepare()
    assert len(crumbs(one)) == 2
    types = one | {"digs_warp.a.c": "if TYPE_CHECKING:\n    import digs_warp.a.b\nd = 1"}
    TopologicalSorter(module_graph(types)).prepare()
    assert crumbs(types) == ["digs_warp.a.c (3 lines) belongs into digs_warp.a.b"]
    elsewhere = {**types, "digs_warp.e.f": "from digs_warp.a.c import d"}
    assert crumbs(elsewhere) == []


def test_the_rule_itself() -> None:
    for module, source, allowed in (
        ("geometry.camera", "from digs_warp.geometry.rigid import rigid", True),
        ("geometry.camera", "import digs_warp.data.capture", False),
        ("splat.render", "from digs_warp import __version__", True),
        ("splat.render", "from digs_warp.splat.project import project", True),
        ("splat.render", "from digs_warp.init import recipes", False),
        ("splat.render", "def f():\n    from digs_warp.sim import scene", False),
        ("sim.record.record", "from digs_warp.usd.writer import write_gaussians", False),
        ("pipeline.reconstruct", "import digs_warp.show.report", False),
        ("train.trainer", "from digs_warp.pipeline import reconstruct", False),
        ("commands.run", "import digs_warp.cli, digs_warp.usd.writer", True),
    ):
        assert (violations(f"digs_warp.{module}", source) == []) == allowed, source
