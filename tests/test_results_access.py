"""Results of a reconstruction are read in one place: nobody else opens its files or takes JSON keys."""

import ast
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parent.parent
PACKAGES = ("digs_warp", "sim", "usd", "scripts", "examples")

# The files of a reconstruction, by their constants in `digs_warp.record.layout` and by name.
FILES = {"EVALUATION", "TRAINING", "evaluation.json", "training.jsonl"}
RUN_RECORD = {"RUN_RECORD", "run.json"}

OWNERS = {
    "digs_warp/record/layout.py",  # the names
    "digs_warp/pipeline/reconstruction.py",
    "digs_warp/pipeline/records.py",
    "digs_warp/pipeline/reconstruct.py",  # resumes from them
    "digs_warp/pipeline/optimize.py",  # takes over a finished training
    "digs_warp/train/session.py",  # writes the course
    "digs_warp/commands/output.py",  # names what --overwrite may delete
}
# May take values by key out of a run.json's results.
RECORD_READERS = {
    "digs_warp/pipeline/records.py",
    "digs_warp/data/about.py",  # of a simulated capture
    "digs_warp/data/capture.py",  # says which capture a folder of results belongs to
}


SOURCES = [path for package in PACKAGES for path in sorted((REPOSITORY / package).rglob("*.py"))]


def names_in(node: ast.AST) -> set[str]:
    """Constants and names below ``node``: what a call is told to read."""
    found: set[str] = set()
    for child in ast.walk(node):
        if isinstance(child, ast.Name):
            found.add(child.id)
        elif isinstance(child, ast.Attribute):
            found.add(child.attr)
        elif isinstance(child, ast.Constant) and isinstance(child.value, str):
            found.add(child.value)
    return found


def takes_results(node: ast.AST) -> bool:
    """Whether ``node`` is ``x.results["key"]``, as a value, or ``x.results.get(...)``."""
    if isinstance(node, ast.Subscript) and isinstance(node.ctx, ast.Load):
        value, key = node.value, node.slice
        return (
            isinstance(value, ast.Attribute)
            and value.attr == "results"
            and isinstance(key, ast.Constant)
        )
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
        value = node.func.value
        return (
            node.func.attr == "get" and isinstance(value, ast.Attribute) and value.attr == "results"
        )
    return False


def violations(name: str, source: str) -> list[str]:
    tree = ast.parse(source)
    found = []
    for node in ast.walk(tree):
        where = f"{name}:{getattr(node, 'lineno', 0)}"
        if isinstance(node, ast.Call) and name not in OWNERS:
            called = node.func.id if isinstance(node.func, ast.Name) else ""
            if called == "read_json" and names_in(node) & (FILES | RUN_RECORD):
                found.append(f"{where}: read_json; take a Reconstruction or a RunRecord")
        if isinstance(node, ast.Name | ast.Attribute) and name not in OWNERS:
            if (node.id if isinstance(node, ast.Name) else node.attr) in FILES:
                found.append(f"{where}: names a file of the reconstruction")
        if takes_results(node) and name not in RECORD_READERS:
            found.append(f"{where}: takes results by key")
    return found


def test_results_are_read_in_one_place() -> None:
    files = {str(path.relative_to(REPOSITORY)): path for path in SOURCES}
    assert [
        found
        for name, path in files.items()
        for found in violations(name, path.read_text(encoding="utf-8"))
    ] == []


def test_the_rule_itself() -> None:
    for source, allowed in [
        ('read_json(folder / RUN_RECORD, "run record")["seconds"]', False),
        ('read_json(folder / "evaluation.json", "evaluation")["mean"]', False),
        ("from digs_warp.record import layout\n(folder / layout.EVALUATION).is_file()", False),
        ('log.results["scale"]["width"]', False),
        ('record.results.get("sha256")', False),
        ("log.save(folder / RUN_RECORD)", True),
        ('log.results = {"frames": 3}', True),
        ("Reconstruction.load(folder).scores.mean.psnr_frame", True),
    ]:
        assert (violations("digs_warp/commands/x.py", source) == []) == allowed, source
