"""Comments that the pages' scripts lose before they are sent."""

from __future__ import annotations

from pathlib import Path

import pytest

from rid_daq.web.bundled_modules import bundled_modules
from rid_daq.web.script_comments import without_comments
from rid_daq.workbench.static_files import static_files
from tests.builders.code_lines import PACKAGES
from tests.builders.javascript_types import ROOT, compiled_scripts

SCRIPT = """\
// A module.
/** @type {(a: string) => string} */
const word = (a) => /** @type {string} */ (a); // at the end of a line
/**
 * More.
 */
const link = "https://example.org"; const power = 2 ** 3;
"""
SENT = """\


const word = (a) => (a); // at the end of a line



const link = "https://example.org"; const power = 2 ** 3;
"""


def test_comments_and_types_are_removed_and_lines_keep_their_numbers() -> None:
    assert without_comments(SCRIPT) == SENT


def test_scripts_are_sent_without_types() -> None:
    ours = {name: text for name, text in static_files().items() if name not in bundled_modules()}
    scripts = {name: text.decode() for name, text in ours.items() if name.endswith(".js")}
    assert len(scripts) > 40
    assert [name for name, text in scripts.items() if "/**" in text] == []


def changed_scripts(scripts: dict[str, str], folder: Path) -> list[str]:
    """Return the names of the scripts that are different programs without their comments."""
    sent = {name: without_comments(text) for name, text in scripts.items()}
    texts = ((folder / "written", scripts), (folder / "sent", sent))
    for place, _ in texts:
        place.mkdir()
    written, compiled = (compiled_scripts(each, place) for place, each in texts)
    assert written.keys() == compiled.keys() == scripts.keys()
    return [name for name in scripts if written[name] != compiled[name]]


def test_removing_the_comments_changes_no_script_that_is_sent(tmp_path: Path) -> None:
    paths = [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.js"))]
    ours = [path for path in paths if not {"bundled", "site"} & {*path.parts}]
    scripts = {"_".join(path.relative_to(ROOT).parts): path.read_text() for path in ours}
    assert len(scripts) > 50
    assert changed_scripts(scripts, tmp_path) == []


@pytest.mark.parametrize(
    "string",
    ['"a /** b */ c"', "`a\n  // b\nc`", "`${1}\n// b`", "/[/**]/.source + '*/'"],
)
def test_a_string_that_begins_like_a_comment_is_found(string: str, tmp_path: Path) -> None:
    assert changed_scripts({"a.js": f"export const a = {string};\n"}, tmp_path) == ["a.js"]
