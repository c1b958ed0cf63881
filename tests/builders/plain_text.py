"""Find phrases that are hard to read: `python -m tests.builders.plain_text [FOLDER ...]`.

It reads docstrings, texts, comments, Markdown, pages and scripts. Each hit names a replacement.
"""

from __future__ import annotations

import ast
import io
import re
import sys
import tokenize
from collections.abc import Iterator
from functools import cache, lru_cache
from pathlib import Path
from typing import Final, NamedTuple

from tests.builders.code_lines import ROOT
from tests.builders.syntax_trees import text_of, tree_of

LONGEST_SENTENCE: Final = 45
"""Maximum number of words of a sentence; aim at about 25."""

NAMES: Final = frozenset(
    (
        "told",
        "said",
        "taken",
        "given",
        "signed",
        "asked",
        "moment",
        "seen",
        "done",
        "kept",
        "wanted",
    )
)
"""Words that functions and classes must not have as names."""

PHRASES: Final = {
    r"\bwhere (?:a|an|the|one|that|this|it|they|none|no|not|its|their|nothing|several)\b": (
        "a condition is 'if' or 'when'; a place is 'in which'"
    ),
    r"\bwhere none\b|\bwhere there (?:is|are)\b": "a condition is 'if' or 'when'",
    r"\b(?:is|are|was|were) told\b|\btells? (?:of|apart|whether|what|which)\b": (
        "'receives', 'shows', 'distinguishes'"
    ),
    r"\bstands? (?:in|at|on|for|there|beside|behind|before)\b|\bstood\b": "'is in', 'is at'",
    r"\b(?:of it|of them|thereof)\b": "'its', 'their', or the noun",
    r"\b(?:nobody|somebody|everybody|whoever|whom)\b": "'no one' or the role: user, client",
    r"\b(?:is|are|was|were) (?-i:none)\b": "'does not exist', 'no …'",
    r"\b(?:became|becomes|come|comes|came) of\b": "'outcome', 'result'",
    r"\bin place of\b": "'instead of'",
    r"\bas far as\b|\bby how (?:much|far)\b": "'if', 'the amount by which'",
    r"\bmay not be\b|\bmust no\b": "'cannot' or 'must not'",
    r"\bbeside (?:it|them)\b": "'next to', 'in addition to'",
    r"\b(?:gives? way|friction that remembers|holds at once)\b": "presliding hysteresis",
    r"\b(?:behold|bears?|shall|ought|lest|hence|thereby|wherein|whereby|henceforth)\b": (
        "plain verbs"
    ),
}
"""Regular expression of each phrase, and its replacement."""

_ANY_PHRASE: Final = re.compile("|".join(PHRASES), re.IGNORECASE)

FIRST_WORDS: Final = ("What", "Which", "Whether", "Who", "Whom", "How", "Where")
"""Words with which no docstring begins."""

_PAGES: Final = {
    ".md": r"((?:^.+\n?)+)",
    ".html": r">([^<>{}]{4,})<|(?:title|alt|placeholder|aria-label)=\"([^\"{}]{4,})\"",
    ".js": r"//\s?(.+(?:\n[ \t]*//.+)*)|\"([^\"\n]{4,})\"|`([^`]{4,})`|/\*\*?([\s\S]*?)\*/",
    ".yaml": r"#\s?(.+(?:\n[ \t]*#.+)*)",
    ".toml": r"= \"(.+)\"",
}

_COMMENT_MARKS: Final = {".js": "//", ".yaml": "#"}


class Hit(NamedTuple):
    """A phrase to rewrite: file and line, the phrase, and its replacement."""

    place: str
    phrase: str
    advice: str


class Passage(NamedTuple):
    """A text for readers, with its line and a flag for docstrings."""

    line: int
    text: str
    is_docstring: bool = False


class Name(NamedTuple):
    """A function or class, with its line."""

    line: int
    text: str


@cache
def passages(path: Path) -> tuple[Passage, ...]:
    if path.suffix == ".py":
        return tuple(_of_python(path))
    source = path.read_text(encoding="utf-8")
    if path.suffix == ".md":
        source = re.sub(r"^```.*?^```$|^ {4}[^\n]*$", _blank, source, flags=re.M | re.S)
    mark = _COMMENT_MARKS.get(path.suffix, "")
    return tuple(
        Passage(
            source.count("\n", 0, match.start()) + 1,
            re.sub(rf"\n\s*{mark} ?", "\n", next(each for each in match.groups() if each)),
        )
        for match in re.finditer(_PAGES[path.suffix], source, re.MULTILINE)
    )


def _blank(match: re.Match[str]) -> str:
    """Return the line ends of a code block, so that line numbers stay right."""
    return "\n" * match[0].count("\n")


def _of_python(path: Path) -> Iterator[Passage]:
    docstrings = set()
    nodes = _nodes(path)
    for node in nodes:
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and (
            text := ast.get_docstring(node)
        ):
            docstrings.add(node.body[0].lineno)
            yield Passage(node.body[0].lineno, text, is_docstring=True)
    parts = {
        id(part)
        for node in nodes
        if isinstance(node, ast.JoinedStr)
        for part in ast.walk(node)
        if part is not node
    }
    for node in nodes:
        if not isinstance(node, ast.Constant | ast.JoinedStr) or id(node) in parts:
            continue
        text = _text(node)
        if node.lineno not in docstrings and len(text.split()) > 2:
            yield Passage(node.lineno, text)
    yield from _comments(text_of(path))


def _comments(source: str) -> Iterator[Passage]:
    """Yield the comments of a Python source; comments in consecutive lines are one passage."""
    first, last, lines = 0, 0, list[str]()
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type != tokenize.COMMENT:
            continue
        row, column = token.start
        if lines and (row > last + 1 or token.line[:column].strip()):
            yield Passage(first, "\n".join(lines))
            lines = []
        first = first if lines else row
        lines.append(token.string[1:])
        last = row
    if lines:
        yield Passage(first, "\n".join(lines))


@lru_cache(maxsize=1)
def _nodes(path: Path) -> tuple[ast.AST, ...]:
    """Return the nodes of a Python file's syntax tree; the last file is remembered."""
    return tuple(ast.walk(tree_of(path)))


def _text(node: ast.Constant | ast.JoinedStr) -> str:
    """Return a text; the values in an f-string are shown as `{...}`."""
    if isinstance(node, ast.JoinedStr):
        return "".join(
            str(part.value) if isinstance(part, ast.Constant) else "{...}" for part in node.values
        )
    return node.value if isinstance(node.value, str) else ""


def hits(path: Path) -> Iterator[Hit]:
    """Yield the phrases of a file that break a rule."""
    for passage in passages(path):
        place = f"{path.relative_to(ROOT)}:{passage.line}"
        text = re.sub(r"`[^`]*`", "CODE", passage.text)
        for phrase, advice in PHRASES.items() if _ANY_PHRASE.search(text) else ():
            for match in re.finditer(phrase, text, re.IGNORECASE):
                around = text[max(0, match.start() - 30) : match.end() + 20]
                yield Hit(place, " ".join(around.split()), advice)
        first = text.split(maxsplit=1)[0] if text.split() else ""
        if passage.is_docstring and first in FIRST_WORDS:
            yield Hit(place, " ".join(text.split()[:6]), "begin with a verb or a noun phrase")
        for sentence in _sentences(text) if passage.is_docstring else ():
            if len(sentence) > LONGEST_SENTENCE:
                yield Hit(place, " ".join(sentence[:6]), f"{len(sentence)} words: split it")
    for name in names(path):
        if name.text.strip("_").lower() in NAMES:
            place = f"{path.relative_to(ROOT)}:{name.line}"
            yield Hit(place, name.text, "a noun for a class, a verb for a function")


def names(path: Path) -> Iterator[Name]:
    """Yield the functions and classes of a Python file."""
    if path.suffix == ".py":
        for node in _nodes(path):
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                yield Name(node.lineno, node.name)


def _sentences(text: str) -> list[list[str]]:
    """Return the words of each sentence; entries of a section are sentences of their own."""
    parts = re.split(r"(?<=[.;:!?])\s+(?=[A-Z`\\w])|\n\s*\n|\n\s+(?=[\w, *]+: )", text)
    return [part.split() for part in parts]


def words(path: Path) -> int:
    """Return the number of words that a person reads in a file."""
    return sum(len(passage.text.split()) for passage in passages(path))


_BUILT: Final = {ROOT / "rid_daq" / "site", ROOT / "rid_daq" / "workbench" / "bundled"}


def files(folder: Path) -> list[Path]:
    """Return the files with texts below a folder, or the file itself, without files of a build."""
    found = [folder] if folder.is_file() else sorted(folder.rglob("*"))
    return [
        each
        for each in found
        if each.suffix in (".py", *_PAGES) and each.is_file() and not _BUILT & set(each.parents)
    ]


def main() -> None:
    """Print the hits below the named folders, and hits per 1,000 words of each."""
    for name in sys.argv[1:] or ["."]:
        read = files(ROOT / name)
        found = [hit for path in read for hit in hits(path)]
        for hit in found:
            sys.stdout.write(f"{hit.place}: {hit.phrase!r}: {hit.advice}\n")
        count = sum(map(words, read))
        sys.stdout.write(f"{name}: {1000 * len(found) / max(count, 1):.1f} of 1,000 words\n")


if __name__ == "__main__":
    main()
