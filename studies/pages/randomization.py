"""The tables of docs/randomization.md: what can be drawn, and what ours draw."""

import ast
import inspect
from dataclasses import fields, is_dataclass
from typing import Any, get_type_hints

from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.randomize.settings_file import (
    DISTRACTOR_MESH_COUNT,
    OBJECT_COUNT,
    SHIPPED,
    known_keys,
    load_randomization,
)
from digs_warp.study.table import Table
from scripts.page_marks import fill

PAGE = "randomization.md"

# What is drawn beside the settings.
COUNTS = {
    OBJECT_COUNT: "Number of objects, each another file of `--meshes` or of the key `mesh`. With 1 the "
    "recording has a `mesh`, with more a `scene`.",
    DISTRACTOR_MESH_COUNT: "Number of `distractor_meshes`, from the same files.",
}


def main() -> None:
    """Fill the page."""
    for mark, text in texts().items():
        fill(PAGE, mark, text)


def texts() -> dict[str, str]:
    """Return the tables by mark."""
    ours = {name: load_randomization(name).entries for name in SHIPPED}
    drawn = [key for key in known_keys() if any(key in entries for entries in ours.values())]
    shipped = [
        [f"`{key}`", *(f"`{e[key].words}`" if key in e else "" for e in ours.values())]
        for key in drawn
    ]
    about = {**COUNTS, **help_texts(SimulateConfig)}
    keys = [[f"`{key.name}`", values_of(key), about[key.name]] for key in known_keys().values()]
    return {
        "ours": Table("ours", ["key", *(f"`{name}`" for name in ours)], shipped).markdown(),
        "keys": Table("keys", ["key", "values", "what it is"], keys).markdown(),
    }


def values_of(key: Any) -> str:
    """Return in words what a key takes."""
    items = ", ".join(f"`{word}`" for word in key.words) or key.kind
    whole = f"list: {items}" if key.is_list else items
    return f"{whole}; one draw for each object" if key.per_object else whole


def help_texts(settings: type) -> dict[str, str]:
    """Return the first sentences of the settings' help, by name, also of settings within."""
    (tree,) = ast.parse(inspect.getsource(settings)).body
    assert isinstance(tree, ast.ClassDef)
    found: dict[str, str] = {}
    for line, after in zip(tree.body, tree.body[1:], strict=False):
        if isinstance(line, ast.AnnAssign) and isinstance(after, ast.Expr):
            text = " ".join(ast.literal_eval(after.value).split())
            found[line.target.id] = text.partition(" Default:")[0]  # pyright: ignore[reportAttributeAccessIssue]
    hints = get_type_hints(settings)
    inner = [hints[each.name] for each in fields(settings) if is_dataclass(hints[each.name])]
    for each in inner:
        found |= help_texts(each)  # pyright: ignore[reportArgumentType]
    return found
