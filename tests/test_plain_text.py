"""Texts are plain English: `python -m tests.builders.plain_text FOLDER` lists what to rewrite."""

from __future__ import annotations

import pytest

from tests.builders.code_lines import ROOT
from tests.builders.plain_text import files, hits, words

HITS_PER_1000_WORDS = {
    "README.md": 0.5,
    "docs/extending.md": 0.5,
    "docs/guide": 0.5,
    "docs/decisions": 0.5,
    "docs/tutorial": 0.5,
    "docs/theory.md": 0.5,
    "docs/architecture.md": 0.5,
    "CONTRIBUTING.md": 0.5,
    "config": 0.7,
    "dynamics": 1.0,
    "drivers": 1.0,
    "acquisition": 0.5,
    "identification": 0.5,
    "compensation": 1.0,
    "mock_hw": 0.5,
    "rid_daq": 0.5,
    "benchmarks": 0.7,
    "tests": 1.0,
}
"""Maximum of findings of the check per 1,000 words; must not grow (goal: 0.5 everywhere)."""


@pytest.mark.parametrize("place", HITS_PER_1000_WORDS)
def test_the_texts_of_a_folder_are_plain_english(place: str) -> None:
    read = files(ROOT / place)
    found = [hit for path in read for hit in hits(path)]
    rate = 1000 * len(found) / sum(map(words, read))
    listed = "\n".join(f"{hit.place}: {hit.phrase!r}: {hit.advice}" for hit in found)
    assert rate <= HITS_PER_1000_WORDS[place], listed
