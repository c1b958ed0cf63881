"""Comments that the pages' scripts lose before they are sent."""

from __future__ import annotations

from rid_daq.web.bundled_modules import bundled_modules
from rid_daq.web.script_comments import without_comments
from rid_daq.workbench.static_files import static_files

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
