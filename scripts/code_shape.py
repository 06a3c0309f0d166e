"""Measure the shape of the code: sizes, comments, parameters, annotations; the longest by name.

python scripts/code_shape.py                # this checkout
python scripts/code_shape.py OTHER --top 10 # another one, for example before a change
"""

import argparse
import ast
import io
import tokenize
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median

SOURCES = ("digs_warp", "sim", "usd", "scripts", "studies", "examples")
FunctionNode = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass(frozen=True)
class Function:
    """One function; a kernel's nested function counts by itself, too."""

    place: str
    lines: int
    parameters: int
    is_kernel: bool
    is_device: bool
    returns: bool


@dataclass
class Shape:
    """What is counted over a set of files."""

    files: dict[str, int] = field(default_factory=dict)
    functions: list[Function] = field(default_factory=list)
    code: int = 0
    comments: int = 0
    docstrings: int = 0

    @property
    def lines(self) -> int:
        """Lines of all files, blank ones included."""
        return sum(self.files.values())


def is_warp(node: FunctionNode, kind: str) -> bool:
    """Whether a function is decorated with ``wp.kernel`` or ``wp.func``, with or without arguments."""
    names = [d.func if isinstance(d, ast.Call) else d for d in node.decorator_list]
    return any(isinstance(name, ast.Attribute) and name.attr.startswith(kind) for name in names)


def length(node: FunctionNode) -> int:
    """Return the lines of a function, decorators left out."""
    return (node.end_lineno or node.lineno) - node.lineno + 1


def functions_in(tree: ast.Module, file: str) -> Iterator[Function]:
    """Yield every function of a file; a method's ``self`` is no parameter."""
    for node in ast.walk(tree):
        if not isinstance(node, FunctionNode):
            continue
        arguments = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
        parameters = [a for a in arguments if a.arg not in ("self", "cls")]
        kernel = is_warp(node, "kernel")
        nested = [n for n in ast.walk(node) if n is not node and isinstance(n, FunctionNode)]
        kernels = sum(length(n) for n in nested if is_warp(n, "kernel"))
        yield Function(
            place=f"{file}:{node.lineno} {node.name}",
            lines=length(node) - kernels,
            parameters=len(parameters),
            is_kernel=kernel,
            is_device=kernel or is_warp(node, "func"),
            returns=node.returns is not None,
        )


def docstring_lines(tree: ast.Module) -> set[int]:
    """Return the numbers of the lines that hold docstrings, of attributes as well."""
    found: set[int] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            if isinstance(node.value.value, str):
                found |= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return found


def measure(root: Path, folders: tuple[str, ...]) -> Shape:
    """Return the shape of the Python files below some folders."""
    shape = Shape()
    for path in sorted(p for folder in folders for p in (root / folder).rglob("*.py")):
        source = path.read_text(encoding="utf-8")
        file = str(path.relative_to(root))
        tree = ast.parse(source)
        shape.files[file] = len(source.splitlines())
        shape.functions += functions_in(tree, file)
        docstrings = docstring_lines(tree)
        comments, code = set[int](), set[int]()
        for token in tokenize.generate_tokens(io.StringIO(source).readline):
            if token.type == tokenize.COMMENT:
                comments.add(token.start[0])
            elif token.string.strip():
                code |= set(range(token.start[0], token.end[0] + 1))
        shape.docstrings += len(docstrings)
        shape.comments += len(comments)
        shape.code += len(code - docstrings)
    return shape


def percentile(values: list[int], share: float) -> int:
    """Return the value below which ``share`` of the values lie."""
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))]


def table(shape: Shape, tests: Shape) -> str:
    """Return the numbers as a Markdown table."""
    lengths = [f.lines for f in shape.functions]
    host = [f for f in shape.functions if not f.is_device]
    kernels = [f for f in shape.functions if f.is_kernel]
    cells = {
        "files": f"{len(shape.files)}",
        "lines": f"{shape.lines:,}",
        "file median/max": f"{median(shape.files.values()):g} / {max(shape.files.values())}",
        "function median/p90/max": f"{median(lengths):g} / {percentile(lengths, 0.9)} / {max(lengths)}",
        "longest host function": f"{max(f.lines for f in host)}",
        "comment:code": f"{shape.comments / shape.code:.2f}",
        "docstring:code": f"{shape.docstrings / shape.code:.2f}",
        "most parameters": f"host {max(f.parameters for f in host)}, "
        f"kernel {max(f.parameters for f in kernels)}",
        "returns annotated": f"{sum(f.returns for f in host) / len(host):.0%}",
        "tests:src": f"{tests.lines / shape.lines:.2f}",
    }
    return "\n".join(
        f"| {' | '.join(row)} |" for row in (cells, ["---"] * len(cells), cells.values())
    )


def worst(shape: Shape, count: int) -> str:
    """Return the longest files and host functions."""
    host = [(f.lines, f.place) for f in shape.functions if not f.is_device]
    groups = {
        "longest files": [(n, f) for f, n in shape.files.items()],
        "longest host functions": host,
    }
    lines = []
    for title, rows in groups.items():
        largest = sorted(rows, reverse=True)[:count]
        lines += ["", f"{title}:", *(f"  {number:5d}  {place}" for number, place in largest)]
    return "\n".join(lines)


def main() -> None:
    """Print the table and the extremes."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("root", type=Path, nargs="?", default=Path(__file__).parents[1])
    parser.add_argument("--top", type=int, default=5)
    arguments = parser.parse_args()
    shape = measure(arguments.root, SOURCES)
    print(table(shape, measure(arguments.root, ("tests",))))  # noqa: T201
    print(worst(shape, arguments.top))  # noqa: T201


if __name__ == "__main__":
    main()
