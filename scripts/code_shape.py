"""Measure the shape of the code: lines, functions, comments, words of the documentation; the longest by name.

python scripts/code_shape.py [OTHER] [--top 10]   # this checkout or another one, before a change
"""

import argparse
import ast
import io
import tokenize
from dataclasses import dataclass, field
from pathlib import Path

PARTS = {
    "product": ("digs_warp", "sim", "usd"),
    "scripts and studies": ("scripts", "studies"),
    "tests": ("tests",),
}
FunctionNode = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass
class Shape:
    """What is counted over a set of files; functions without their decorators, by place."""

    files: dict[str, int] = field(default_factory=dict)
    functions: dict[str, int] = field(default_factory=dict)
    comments: int = 0


def measure(root: Path, folders: tuple[str, ...]) -> Shape:
    """Return the shape of the Python files below some folders; links are not followed."""
    shape = Shape()
    for path in sorted(p for folder in folders for p in (root / folder).rglob("*.py")):
        source = path.read_text(encoding="utf-8")
        file = str(path.relative_to(root))
        tree = ast.parse(source)
        shape.files[file] = len(source.splitlines())
        for node in ast.walk(tree):
            if isinstance(node, FunctionNode):
                lines = (node.end_lineno or node.lineno) - node.lineno + 1
                shape.functions[f"{file}:{node.lineno} {node.name}"] = lines
        tokens = tokenize.generate_tokens(io.StringIO(source).readline)
        shape.comments += sum(token.type == tokenize.COMMENT for token in tokens)
    return shape


def summary(name: str, shape: Shape) -> str:
    """Return the numbers of a part as a line."""
    lengths = sorted(shape.functions.values())
    return (
        f"{name}: {sum(shape.files.values()):,} lines in {len(shape.files)} files, {shape.comments:,} "
        f"comments; functions: {lengths[len(lengths) // 2]} lines in the median, "
        f"{lengths[int(0.9 * len(lengths))]} at 90 %"
    )


def main() -> None:
    """Print a line for each part, and the longest files and functions of the product."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("root", type=Path, nargs="?", default=Path(__file__).parents[1])
    parser.add_argument("--top", type=int, default=5)
    given = parser.parse_args()
    shapes = {name: measure(given.root, folders) for name, folders in PARTS.items()}
    lines = [summary(name, shape) for name, shape in shapes.items()]
    pages = [given.root / "README.md", *(given.root / "docs").rglob("*.md")]
    words = sum(len(page.read_text(encoding="utf-8").split()) for page in pages)
    lines.append(f"documentation: {words:,} words on {len(pages)} pages")
    for largest in (shapes["product"].files, shapes["product"].functions):
        ranked = sorted(largest.items(), key=lambda entry: -entry[1])[: given.top]
        lines += ["", *(f"{number:5d}  {place}" for place, number in ranked)]
    print("\n".join(lines))  # noqa: T201


if __name__ == "__main__":
    main()
