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
have the same remedy. A code does not change if its message is worded differently. For example,
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
    found: defaultdict[str, set[str]] = defaultdict(set)
    for package in PACKAGES:
        texts = (path.read_text("utf-8") for path in sorted((ROOT / package).rglob("*.py")))
        for text in texts:
            for node in ast.walk(ast.parse(text)) if "RID-" in text else ():
                if isinstance(node, ast.Call):
                    for code in _codes(node):
                        found[code] |= {_text(each) for each in node.args}
    return {
        code: tuple(sorted((each for each in texts if _is_informative(each)), key=_order))
        for code, texts in found.items()
    }


def _codes(call: ast.Call) -> list[str]:
    """Return the error codes that are literals in the argument `code` of a call."""
    values = [keyword.value for keyword in call.keywords if keyword.arg == "code"]
    constants = [each for value in values for each in ast.walk(value)]
    texts = [each.value for each in constants if isinstance(each, ast.Constant)]
    return [each for each in texts if isinstance(each, str) and each.startswith("RID-")]


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
