"""The number of assertions on sentences must not grow."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from tests.builders.code_lines import ROOT
from tests.builders.sentence_assertions import sentence_assertions

TESTS: Final = ROOT / "tests"
AT_MOST: Final = 71
"""Maximum number of assertions on sentences; it must only decrease."""


def test_the_number_of_assertions_on_sentences_does_not_grow() -> None:
    places = [f"{path.relative_to(ROOT)}:{line}" for path, line in sentence_assertions(TESTS)]
    assert len(places) <= AT_MOST, places


def test_each_kind_of_sentence_is_counted(tmp_path: Path) -> None:
    (tmp_path / "test_some.py").write_text(
        'with pytest.raises(Error, match="x"): pass\n'
        'with raises_code(Error, "RID-FILE-READ", "is not there"): pass\n'
        'with raises_invalid("key", "is not there"): pass\n'
        'assert "cannot open" in str(caught.value)\n'
        'with raises_code(Error, "RID-FILE-READ", "cell.yaml:41"): pass\n'
    )
    assert sorted(line for _, line in sentence_assertions(tmp_path)) == [1, 2, 3, 4]


def test_sentences_in_variables_are_counted_at_their_assertion(tmp_path: Path) -> None:
    (tmp_path / "test_some.py").write_text(
        'TEXT = "cannot open"\n'
        "def test_a():\n"
        "    assert TEXT in str(caught.value)\n"
        '@pytest.mark.parametrize(("code", "said"), [("RID-FILE-READ", "is not there")])\n'
        "def test_b(code, said):\n"
        "    with raises_code(Error, code, said): pass\n"
        "    assert code in str(caught.value)\n"
        "def test_c():\n"
        '    for said in ("one word", "cell.yaml:41"):\n'
        "        assert said in str(caught.value)\n"
        "def test_d(said):\n"
        "    assert said in str(caught.value)\n"
    )
    assert sorted(line for _, line in sentence_assertions(tmp_path)) == [3, 6, 10]
