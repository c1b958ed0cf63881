"""Write the page of the error codes: `python docs/reference/errors.py`.

The page is made from the declarations of the codes and from the code that raises the errors.
`tests/test_reference.py` fails if the page is out of date.
"""

from __future__ import annotations

import ast
from collections import defaultdict
from pathlib import Path
from typing import Final

from config.error_codes import declared_codes

HERE: Final = Path(__file__).resolve().parent
ROOT: Final = HERE.parents[1]
PACKAGES: Final = (
    *("config", "dynamics", "drivers", "acquisition"),
    *("identification", "compensation", "mock_hw", "rid_daq"),
)
MOST_EXAMPLES: Final = 3
HEAD: Final = """# Error codes

Every error message ends with a code in brackets, such as `[RID-FILE-READ]`. The same code is the
value of `code` in the `--json` document and in the service's answers. All errors with the same code
have the same remedy. A code does not change if its message is worded differently.
`rid-daq docs RID-FILE-READ` prints the entry of this code, without a browser or a network.

The examples are the messages of the program, with … instead of the values in them.
"""


def errors() -> str:
    """Return the page: every code with cause, remedy and examples, by area."""
    messages = _messages()
    parts, area = [HEAD], ""
    for code in declared_codes():
        first = code.name.split("-")[1]
        if first != area:
            area = first
            parts.append(f"## {area.capitalize()}\n")
        parts.append(f"### {code.name}\n\n{code.cause}\n\n**Remedy:** {code.remedy}\n")
        examples = messages.get(code.name, ())[:MOST_EXAMPLES]
        parts += ["\n".join(f"- {_literal(text)}" for text in examples) + "\n"] if examples else []
    return "\n".join(parts)


def _messages() -> dict[str, tuple[str, ...]]:
    """Return the messages that the packages construct, by error code, the longest first."""
    paths = [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]
    modules = {_name(path): ast.parse(path.read_text("utf-8")) for path in paths}
    own = {name: _own_constants(module) for name, module in modules.items()}
    found: defaultdict[str, set[str]] = defaultdict(set)
    for name, module in modules.items():
        constants = own[name] | _imported_constants(module, own)
        for node in ast.walk(module):
            if isinstance(node, ast.Call):
                for code in _codes(node, constants):
                    found[code] |= {_text(each) for each in node.args}
    return {
        code: tuple(sorted((each for each in texts if _is_informative(each)), key=_order))
        for code, texts in found.items()
    }


def _name(path: Path) -> str:
    """Return the name by which a file of a package is imported."""
    return ".".join(path.relative_to(ROOT).with_suffix("").parts)


def _own_constants(module: ast.Module) -> dict[str, str]:
    """Return the constants of a module that are error codes."""
    found = {}
    for node in module.body:
        if isinstance(node, (ast.Assign, ast.AnnAssign)) and _is_code(node.value):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            found |= {ast.unparse(each): ast.literal_eval(node.value) for each in targets}
    return found


def _imported_constants(module: ast.Module, own: dict[str, dict[str, str]]) -> dict[str, str]:
    """Return the constants with error codes that a module imports from another one."""
    return {
        each.asname or each.name: own[node.module][each.name]
        for node in ast.walk(module)
        if isinstance(node, ast.ImportFrom) and node.module in own
        for each in node.names
        if each.name in own[node.module]
    }


def _is_code(node: ast.AST | None) -> bool:
    """Return True if an expression is a literal error code."""
    return (
        isinstance(node, ast.Constant)
        and isinstance(node.value, str)
        and node.value.startswith("RID-")
        and " " not in node.value
    )


def _codes(call: ast.Call, constants: dict[str, str]) -> list[str]:
    """Return the error codes among the arguments of a call, as literals or constants."""
    given = [word.value for word in call.keywords if word.arg == "code"]
    found = []
    for node in (*call.args, *(each for value in given for each in ast.walk(value))):
        if _is_code(node):
            found.append(ast.literal_eval(node))
        elif isinstance(node, ast.Name) and node.id in constants:
            found.append(constants[node.id])
    return found


def _text(node: ast.expr) -> str:
    """Return a message with … instead of computed values."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if isinstance(node, ast.JoinedStr):
        return "".join(_text(each) for each in node.values)
    if isinstance(node, ast.BinOp):
        return _text(node.left) + _text(node.right)
    return "…"


def _is_informative(text: str) -> bool:
    """Return True if a message is one line and has at least four words without computed values."""
    words = [word for word in text.split() if "…" not in word]
    return len(words) >= 4 and "\n" not in text


def _literal(text: str) -> str:
    """Return a message as Markdown code, which is shown unchanged."""
    return f"`` {text} ``" if "`" in text else f"`{text}`"


def _order(text: str) -> tuple[int, str]:
    return -len(text), text


def main() -> None:
    """Write the page."""
    (HERE / "errors.md").write_text(errors(), encoding="utf-8")


if __name__ == "__main__":
    main()
