"""Draw the packages from their imports into docs/architecture.md: `python docs/architecture.py`.

`tests/test_architecture.py` fails if the drawing differs from the imports in the code.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs/architecture.md"
PACKAGES = (
    "rid_daq", "compensation", "mock_hw", "identification", "acquisition", "drivers", "dynamics",
    "config",
)  # fmt: skip
BEGIN, END = "<!-- drawn by docs/architecture.py -->\n", "<!-- end of the drawing -->\n"

Graph = dict[str, set[str]]


def find_imports(path: Path) -> set[str]:
    """Return the project's modules that a file imports, also inside functions."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module and not node.level:
            found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
    return {name for name in found if name.split(".")[0] in PACKAGES}


def files() -> Iterator[tuple[Path, list[str]]]:
    """Yield every file of the packages, with the parts of its module name."""
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            if path.name != "__init__.py":
                yield path, list(path.relative_to(ROOT).with_suffix("").parts)


def drawing() -> str:
    """Return the drawing: packages, their subpackages, and the imports between them."""
    subpackages: Graph = {}
    packages: Graph = {package: set() for package in PACKAGES}
    for path, parts in files():
        for name in find_imports(path):
            other = name.split(".")
            if other[0] != parts[0]:
                packages[parts[0]].add(other[0])
            elif len(parts) > 2 and _is_subpackage(other) and other[1] != parts[1]:
                subpackages.setdefault(_subpackage(parts), set()).add(_subpackage(other))
        if len(parts) > 2:
            subpackages.setdefault(_subpackage(parts), set())
    lines = ["```mermaid", "flowchart TB"]
    for package in PACKAGES:
        lines.append(f"  subgraph {package}")
        own = {subpackage for subpackage in subpackages if subpackage.split(".")[0] == package}
        lines += [
            f"    {_node(subpackage)}[{subpackage.partition('.')[2]}]" for subpackage in sorted(own)
        ]
        inside = _reduce({subpackage: subpackages[subpackage] for subpackage in own})
        lines += [f"    {_node(a)} --> {_node(b)}" for a, b in inside]
        lines.append("  end")
    lines += [f"  {a} ==> {b}" for a, b in _reduce(packages)]
    return "\n".join([*lines, "```", ""])


def _subpackage(parts: list[str]) -> str:
    """Return the subpackage of a module.

    Operations on the service are a separate subpackage, because they import the service; the
    service imports all other operations.
    """
    return ".".join(parts[: 3 if parts[:3] == ["rid_daq", "operations", "service"] else 2])


def _node(subpackage: str) -> str:
    return subpackage.replace(".", "_")


def _is_subpackage(parts: list[str]) -> bool:
    return len(parts) > 1 and (ROOT / parts[0] / parts[1]).is_dir()


def _reduce(graph: Graph) -> list[tuple[str, str]]:
    """Return the edges of a graph without those that also follow from longer paths."""

    def below(node: str, seen: set[str]) -> set[str]:
        for other in graph.get(node, set()) - seen:
            seen.add(other)
            below(other, seen)
        return seen

    return [
        (node, other)
        for node in sorted(graph)
        for other in sorted(graph[node])
        if not any(other in below(third, set()) for third in graph[node] - {other})
    ]


def with_drawing(page: str) -> str:
    """Return the page with a drawing of the present imports."""
    return re.sub(
        f"{re.escape(BEGIN)}.*?{re.escape(END)}",
        lambda _: BEGIN + drawing() + END,
        page,
        flags=re.S,
    )


if __name__ == "__main__":
    PAGE.write_text(with_drawing(PAGE.read_text()))
