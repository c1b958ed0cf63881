"""Draw texts for a panel of readers: `python -m tests.builders.random_texts [COUNT [FOLDER ...]]`.

The seed is the hash of the last commit. Each kind of text is drawn equally often: docstrings of the
packages and of tests, messages and comments of the packages, pages, documents, decision records,
data files. The place of each text is printed, so that the readers' answers can be compared with the
code.
"""

from __future__ import annotations

import random
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from tests.builders.code_lines import PACKAGES, ROOT
from tests.builders.plain_text import Passage, files, passages

_READ = (*PACKAGES, "README.md", "CONTRIBUTING.md", "CHANGELOG.md", "docs", "benchmarks", "tests")
_FEWEST_WORDS = 4
_CODE = re.compile(
    r"=>|&&|\|\||\);|\.map\(|^\(|^import |^from \w+ import |\{\n|\bnew [A-Z]\w+\(|"
    r"^(?:INSERT|SELECT|UPDATE|DELETE|CREATE) [A-Za-z ]*(?:FROM|INTO|SET|TABLE)\b|"
    r"^https?://\S+$|^HTTP/|^\w+: \w+\n\w+: |\\w\+|^, \w+: \[|"
    r"\btype: ignore|\bnoqa: |pragma: no cover|^\d+px |\bPRAGMA |-src '|max-age=|^(?:GET|POST) /|"
    r"\w\.\w+\(|^\[[\w-]+=[\w-]+\], |^\w+\[\w+="
)


def kind_of(path: Path, passage: Passage) -> str:
    if path.suffix == ".md":
        return "decision" if path.parent.name == "decisions" else "document"
    if path.suffix in (".html", ".js"):
        return "page"
    if passage.is_docstring:
        return "docstring of a test" if "tests" in path.parts else "docstring"
    return "text" if path.suffix == ".py" else "data"


def texts(path: Path) -> Iterator[Passage]:
    """Yield the texts of a file that are sentences, without code between the texts of a page."""
    for passage in passages(path):
        words = re.findall(r"[A-Za-z]{2,}", re.sub(r"\$?\{[^}]*(?:\}|$)", "", passage.text))
        if len(words) < _FEWEST_WORDS or re.match(r"\W*<", passage.text):
            continue
        if path.suffix == ".py" and "tests" in path.parts and not passage.is_docstring:
            continue  # inputs and expected parts of messages
        if path.suffix not in (".js", ".py") or not _CODE.search(passage.text):
            yield passage


def draw(seed: str, count: int, names: tuple[str, ...] = _READ) -> list[tuple[str, str]]:
    """Return `count` texts, each after its place; the place begins with the kind."""
    kinds: dict[str, list[tuple[str, str]]] = {}
    for name in names:
        for path in files(ROOT / name):
            for passage in texts(path):
                kind = kind_of(path, passage)
                place = f"{kind}, {path.relative_to(ROOT)}:{passage.line}"
                kinds.setdefault(kind, []).append((place, passage.text))
    source = random.Random(seed)
    for found in kinds.values():
        source.shuffle(found)
    order = sorted(kinds)
    return [kinds[order[number % len(order)]].pop() for number in range(count)]


def main() -> None:
    """Print the drawn texts."""
    head = ["git", "rev-parse", "HEAD"]
    seed = subprocess.run(head, cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 50
    drawn = draw(seed, count, tuple(sys.argv[2:]) or _READ)
    for number, (place, text) in enumerate(drawn, 1):
        sys.stdout.write(f"{number}. [{place}]\n{text.strip()}\n\n")


if __name__ == "__main__":
    main()
