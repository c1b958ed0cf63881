from __future__ import annotations

import base64
import gzip
import hashlib
import json
import random
import re
from dataclasses import fields
from html.parser import HTMLParser
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest
from justhtml import JustHTML

from acquisition.runs.folder import RunFolder
from acquisition.session.timing import CycleStatistics
from config.errors import RecordingError
from rid_daq.blocks.formats import duration, number
from rid_daq.report.result import Result
from rid_daq.report.result_file import read_result
from rid_daq.report.sections.section import CURVE_POINTS
from rid_daq.report.sections.timing import loop_sentence
from rid_daq.report.sections.tracking import magnification
from rid_daq.report.sections.verdict import VerdictCheck, VerdictSection
from rid_daq.report_page.render import render_report
from rid_daq.report_page.write import write_result
from tests.builders.invented import whole_result
from tests.builders.raised_codes import raises_code

LARGEST_BYTES = 3_000_000


class _Page(HTMLParser):
    """Parser that collects addresses, ids, plots, scripts and the content policy of a page."""

    def __init__(self) -> None:
        super().__init__()
        self.loaded: list[str] = []
        self.ids: list[str] = []
        self.scripts: list[tuple[dict[str, str | None], str]] = []
        self.plots: list[str] = []
        self.policy = ""
        self._script: dict[str, str | None] | None = None

    def handle_data(self, data: str) -> None:
        if self._script is not None:
            self.scripts.append((self._script, data))
            self._script = None

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        of = dict(attrs)
        self._script = of if tag == "script" else None
        self.plots += [str(of["data-plot"])] if "data-plot" in of else []
        if of.get("http-equiv") == "Content-Security-Policy":
            self.policy = str(of["content"])
        for name, value in attrs:
            if name in {"src", "href", "xlink:href", "data", "srcset"} and value is not None:
                self.loaded.append(value)
            if name == "id" and value is not None:
                self.ids.append(value)


def _read(page: str) -> _Page:
    parser = _Page()
    parser.feed(page)
    return parser


def result_of(document: dict[str, Any]) -> Result:
    return Result.model_validate_json(json.dumps(document))


@pytest.fixture
def result_without_drawings(result: dict[str, Any]) -> dict[str, Any]:
    """Return the result without drawings, which are slow to render."""
    drawn = ("curves", "truth", "tracking", "timing")
    return {key: value for key, value in result.items() if key not in drawn}


@pytest.fixture(scope="module")
def page() -> str:
    """Return the report of a result with most sections."""
    return render_report(result_of(whole_result()))


def test_the_page_loads_no_other_file(page: str) -> None:
    parsed = _read(page)
    assert all(link.startswith("#") for link in parsed.loaded)
    assert "connect-src" not in parsed.policy
    assert parsed.policy.startswith("default-src 'none';")
    assert not re.search(r"url\((?!#)", page)
    assert "@import" not in page


def test_a_wide_table_scrolls_on_a_narrow_screen() -> None:
    """Each table of the templates is in a box that scrolls."""
    pages = files("rid_daq.report_page") / "templates"
    cut = {
        template.name
        for template in pages.iterdir()
        if re.search(
            r'(?<!<div class="scroll" tabindex="0">)<table|</table>(?!</div>)', template.read_text()
        )
    }
    assert cut == set()


def decompressed(text: str) -> str:
    return gzip.decompress(base64.b64decode(text)).decode()


def csp_hash(text: str) -> str:
    return "'sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() + "'"


def test_the_policy_allows_two_scripts_by_their_hashes(page: str) -> None:
    parsed = _read(page)
    run = [text for of, text in parsed.scripts if of["type"] == "module"]
    allowed = re.search(r"script-src ([^;]*)", parsed.policy)
    assert allowed is not None
    assert allowed[1].split() == [csp_hash(text) for text in run]
    assert len(run) == 2
    assert {of["type"] for of, _ in parsed.scripts} == {"module", "application/octet-stream"}


def test_every_drawing_has_an_interactive_figure(page: str) -> None:
    parsed = _read(page)
    items = {str(of["data-item"]): text for of, text in parsed.scripts if "data-item" in of}
    assert [name.partition("-")[0] for name in parsed.plots] == [
        *("fit", "residual_spectrum", "truth"),
        *("path", "distance", "errors") * 2,
        *("stop", "lateness"),
    ]
    assert list(items) == parsed.plots
    for text in items.values():
        assert json.loads(decompressed(text))["panels"]
    for still in re.findall(r'<div class="still">(.*?)</div>', page, flags=re.DOTALL):
        assert "<svg" in still


def test_a_page_without_drawings_has_no_script() -> None:
    parsed = _read(render_report(Result.new("Recording", "ur10e")))
    assert parsed.scripts == []
    assert "script-src" not in parsed.policy


def test_measured_torque_is_a_thin_line_over_a_wide_one(page: str) -> None:
    drawing = page[page.index("<svg") : page.index("</svg>")]
    line = r'<path [^>]*style="[^"]*stroke: var\(--{}\); stroke-width: ([\d.]+)'
    predicted, measured = (re.search(line.format(hue), drawing) for hue in ("orange", "ink"))
    assert predicted is not None
    assert measured is not None
    assert predicted.start() < measured.start()
    assert float(predicted[1]) > 3.0 * float(measured[1])


def test_drawings_use_the_light_and_dark_colours_of_the_page(
    page: str,
) -> None:
    drawings = "".join(re.findall(r"<svg.*?</svg>", page, flags=re.DOTALL))
    named = set(re.findall(r"var\(--(\w+)\)", drawings))
    assert {"ink", "orange", "blue", "red"} <= named
    assert not re.search(r"#[0-9a-f]{6}", drawings)
    for name in named:
        light, dark = re.findall(rf"--{name}: (#[0-9a-f]{{6}});", page)
        assert light != dark


def test_the_page_is_valid_html(page: str) -> None:
    """Parse by the HTML standard; every parse error fails the test. Encoded data are left out."""
    short = re.sub(r'(<script type="application/octet-stream"[^>]*>)[^<]*', r"\1", page)
    assert not JustHTML(short, strict=True).errors


@pytest.mark.slow
def test_a_report_of_six_axes_with_the_longest_curves_is_below_3_mb(result: dict[str, Any]) -> None:
    """A curve has a fixed maximum number of points; noise is the hardest to compress."""
    draw = random.Random(1)
    joints = [f"axis{i}" for i in range(1, 7)]

    def noise() -> list[float]:
        return [round(draw.gauss(0.0, 30.0), 3) for _ in range(CURVE_POINTS)]

    torque, spectrum = result["curves"]["torque"], result["curves"]["spectrum"]
    (axis, *_), (line, *_) = torque["axes"], spectrum["axes"]
    counted = [int(i % 50 > 5) for i in range(CURVE_POINTS)]
    torque["time_s"] = [round(i / 150.0, 7) for i in range(CURVE_POINTS)]
    torque["axes"] = [
        axis | {"joint": joint, "counted": counted, "measured": noise(), "predicted": noise()}
        for joint in joints
    ]
    spectrum["axes"] = [line | {"joint": joint} for joint in joints]
    result["estimate"]["axes"] = [result["estimate"]["axes"][0] | {"joint": j} for j in joints]
    assert len(render_report(result_of(result)).encode()) < LARGEST_BYTES


def test_every_drawing_has_unique_ids(page: str) -> None:
    ids = _read(page).ids
    assert len(ids) == len(set(ids))


def test_links_inside_drawings_have_targets(page: str) -> None:
    parsed = _read(page)
    link_targets = {link[1:] for link in parsed.loaded} | set(re.findall(r"url\(#([^)]+)\)", page))
    assert link_targets <= set(parsed.ids)


def test_the_verdict_is_the_first_section(
    page: str, result_without_drawings: dict[str, Any]
) -> None:
    assert page.index("Passed: the model predicts") < page.index("<h2>")
    judged = VerdictSection.of(
        [VerdictCheck.of("error", 2.0, "≤", 1.3)], "Failed: badly off", "It is."
    )
    assert 'class="verdict failed"' in render_report(
        result_of(result_without_drawings).with_sections(verdict=judged)
    )


def test_the_page_shows_all_required_parts(page: str) -> None:
    for part in (
        "Runs",
        "Predicted and measured torque",
        "Residual spectrum and noise floor",
        "Parameters with their intervals",
        "rejected period",
        "7 samples are missing",
        "Loop timing",
        "Path errors",
        "deviation magnified 10 times",
        "deviation magnified 1000 times",
        "2 mm of deviation",
        "tuned on it",
        "rid-daq 0.1.0",
        "not an emergency stop",
    ):
        assert part in page
    assert page.count("<svg") == 3 + 1 + 1 + 1 + 1 + 3 * 2


def test_a_value_is_rounded_by_its_interval_and_its_tooltip_has_all_digits(
    page: str,
) -> None:
    row = 'title="1.5432 ± 0.0246">1.543 ± 0.025</td>'
    assert row in page
    assert ">1.5432<" not in page


@pytest.mark.parametrize(
    ("extent_m", "deviation_m", "times"),
    [(0.4, 4.8e-3, 10.0), (0.4, 4.7e-4, 100.0), (0.4, 2.3e-4, 200.0), (0.4, 0.3, 1.0)],
)
def test_a_deviation_is_magnified_by_a_round_number(
    extent_m: float, deviation_m: float, times: float
) -> None:
    assert magnification(extent_m, deviation_m) == times


@pytest.mark.parametrize("section", ["runs", "average", "estimate", "validation"])
def test_a_result_without_a_section_still_has_a_report(
    result_without_drawings: dict[str, Any], section: str
) -> None:
    del result_without_drawings[section]
    assert "</html>" in render_report(result_of(result_without_drawings))


def test_a_result_with_nothing_but_a_title_has_a_report() -> None:
    page = render_report(Result.new("Recording", "ur10e"))
    assert "Nothing to judge" in page


def test_texts_of_devices_and_files_cannot_become_markup(
    result_without_drawings: dict[str, Any],
) -> None:
    evil = "<script>alert(1)</script>"
    result_without_drawings["average"]["rejected"][0]["reason"] = evil
    result_without_drawings["runs"][0]["stop"] = evil
    result_without_drawings["estimate"]["parameters"][0]["words"] = evil
    page = render_report(result_of(result_without_drawings))
    assert evil not in page
    assert page.count("&lt;script&gt;") == 3


def test_equal_results_give_identical_pages(page: str, result: dict[str, Any]) -> None:
    assert render_report(result_of(result)) == page


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "–"),
        (0.0, "0"),
        (12, "12"),
        (-1.23456, "\N{MINUS SIGN}1.235"),
        (1.5e-7, "1.5·10⁻⁷"),
        (float("nan"), "not finite"),
    ],
)
def test_numbers_are_formatted_with_rounded_digits(value: float | None, text: str) -> None:
    assert number(value) == text


def test_durations_are_formatted_with_units() -> None:
    assert duration(47.11) == "47.1 s"
    assert duration(185.0) == "3 min 5 s"


@pytest.fixture
def folder(tmp_path: Path) -> RunFolder:
    return RunFolder.create(tmp_path, "test")


def test_a_result_is_restored_from_its_file(result: dict[str, Any], folder: RunFolder) -> None:
    report = write_result(folder, result_of(result))
    written = json.loads(folder.read("result.json"))
    result["timing"]["made"] = written["timing"]["made"]
    assert written == result
    assert read_result(folder) == result_of(result)
    assert report == folder.path / "report.html"
    assert {"report.html", "result.json"} == set(folder.manifest().files)


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b'{"schema": "else"}', b"\xff\xfe"])
def test_a_file_that_is_not_a_result_is_refused(content: bytes, folder: RunFolder) -> None:
    folder.write("result.json", content)
    with raises_code(RecordingError, "RID-RESULT-UNSOUND", "result.json"):
        read_result(folder)


def test_a_result_of_another_format_is_refused(folder: RunFolder) -> None:
    folder.write("result.json", b'{"schema": "rid-daq result 2", "title": 1}')
    with raises_code(RecordingError, "RID-FILE-FORMAT"):
        read_result(folder)


def test_an_unknown_key_is_named(result: dict[str, Any], folder: RunFolder) -> None:
    result["runs"][0]["colour"] = "red"
    folder.write("result.json", json.dumps(result).encode())
    with raises_code(RecordingError, "RID-RESULT-UNSOUND", "runs.0.colour:"):
        read_result(folder)


def test_a_run_without_a_result_is_refused_with_its_code(folder: RunFolder) -> None:
    with raises_code(RecordingError, "RID-RUN-NO-RESULT", "result.json"):
        read_result(folder)


def test_one_failed_check_fails_a_verdict_and_no_check_gives_none() -> None:
    assert VerdictSection.of([], "", "").passed is None
    good, bad = VerdictCheck.of("a", 1.0, "≤", 1.0), VerdictCheck.of("b", 0.8, "≥", 0.9)
    assert good.passed
    assert not bad.passed
    assert VerdictSection.of([good, bad], "", "").passed is False


def test_a_motion_that_did_not_start_has_a_report(result: dict[str, Any]) -> None:
    (loop,) = result["timing"]["loops"]
    loop["counts"] = [0] * len(loop["counts"])
    head = {key: result[key] for key in ("title", "robot", "verdict", "software", "timing")}
    assert "lateness of the cycle" in render_report(result_of(head))


def test_simulated_time_has_no_histogram_of_late_cycles(result: dict[str, Any]) -> None:
    """Rounding makes cycles late by about 1e-13 s, which is no property of the computer."""
    head = {key: result[key] for key in ("title", "robot", "verdict", "software", "timing")}
    (loop,) = head["timing"]["loops"]
    loop["lateness_max_s"] = 2e-13
    assert "lateness of the cycle" not in render_report(result_of(head))
    names = {each.name for each in fields(CycleStatistics)}
    statistics = CycleStatistics(**{key: value for key, value in loop.items() if key in names})
    assert "in simulated time (lock-step)" in loop_sentence(statistics)
