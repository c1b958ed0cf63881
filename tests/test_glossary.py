"""docs/glossary.md: the terms are in alphabetical order; replaced terms are not used again."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PLACES = (
    "acquisition", "compensation", "config", "drivers", "dynamics", "identification", "mock_hw",
    "rid_daq", "docs/guide", "README.md", "CONTRIBUTING.md",
)  # fmt: skip
REPLACED = {
    r"companions?": "helper process",
    r"HowToEstimate": "EstimationOptions",
    r"HowToWeigh|Weighing": "PayloadOptions, PayloadRequest",
    r"as_warm_as_measured": "with_temperature_compensation",
    r"[Ss]hape parameters?|ShapeParameters?": "nonlinear parameters",
    r"Beliefs?": "assumed",
    r"Doubt": "PriorUncertainty",
    r"reaction wrench|external wrench": "base wrench",
    r"unread_options": "inapplicable_options",
    r"side_by_side": "parallel",
    r"PeriodJudge": "EarlyStop",
    r"[Oo]nlookers?": "observer",
    r"bear_name": "set_process_name",
    r"SWIFT|ALONG|JERKED": "MAX_SPEED and the like",
    r"[Ss]ight": "identifiable subspace",
    r"Stretch": "PathSection",
    r"JudgedPayload": "PayloadResult",
    r"white_equations": "whitened",
    r"LineFaults?|RegisterFaults": "FaultScript",
    r"_?tell_\w+": "report_*, run_*, send_*: what it does",
    r"(?<!benchmarks\.)[Ss]trangers?": "unknown",
    r"termination_(?:held|waits|calls)": "signals_blocked, signals_deferred, signals_handled",
    r"kernels[./]lanes|`lanes`": "simd",
    r"(?:criterion|check|trial|search|self)\.worth": "objective",
    r"(?:together|apart)(?= =)": "joint, combined, separate, difference",
    r"equations_apart": "equations_of_two_robots",
    r"weigh_\w+|is_weighed|PayloadWeighed": "identify_payload, estimate_payload",
    r"Reaction(?:Validation|Equations)|(?:predict|validate|whiten)_reaction": "base wrench",
    r"(?<!data[ -])sheets?(?!/)|(?!(?:test_)?data_sheets)\w+_sheets?|Sheets|SheetFinding": "EDS",
    r"deaf": "blocked, ignored, cut off",
    r"doz(?:e|es|ing)": "deep CPU idle states",
    r"hangs? together": "correlated",
    r"cannot be meant": "is invalid",
    r"nobody can tell": "cannot be estimated",
    r"nobody's name": "an unlinked temporary file",
}
"""Replaced terms, as regular expressions of whole words, and their replacements."""


SITE = ROOT / "rid_daq" / "site"
"""Folder of the documentation site, which exists if a developer has built the site."""


@pytest.fixture(scope="module")
def texts() -> dict[Path, str]:
    """Texts of all checked places, by file."""
    places = [ROOT / place for place in PLACES]
    found = [each for path in places for each in (path.rglob("*") if path.is_dir() else [path])]
    written = (each for each in sorted(found) if SITE not in each.parents)
    kinds = (".py", ".md", ".html", ".yaml")
    return {each: each.read_text() for each in written if each.suffix in kinds}


@pytest.fixture(scope="module")
def suspects(texts: dict[Path, str]) -> dict[Path, str]:
    """Texts that contain any of the replaced terms, by file."""
    any_term = whole_words("|".join(f"(?:{word})" for word in REPLACED))
    return {path: text for path, text in texts.items() if any_term.search(text)}


def whole_words(term: str) -> re.Pattern[str]:
    return re.compile(rf"\b(?:{term})\b")


@pytest.mark.parametrize("word", REPLACED)
def test_a_replaced_term_is_not_used(word: str, suspects: dict[Path, str]) -> None:
    term = whole_words(word)
    found = [str(path.relative_to(ROOT)) for path, text in suspects.items() if term.search(text)]
    assert found == [], f"use '{REPLACED[word]}' (docs/glossary.md)"


def test_the_glossary_is_in_alphabetical_order() -> None:
    page = (ROOT / "docs/glossary.md").read_text()
    words = re.findall(r"^\| ([^|]+) \|", page, re.MULTILINE)[1:]
    words = [word for word in words if not word.startswith("-")]
    assert len(words) > 50
    assert words == sorted(words, key=str.lower)
