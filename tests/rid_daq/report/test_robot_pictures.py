"""Pictures of the robot in reports, in certificates, on pages and on the console."""

from __future__ import annotations

import base64
import io
import json
import re
from pathlib import Path

import numpy as np
import pytest
from justhtml import JustHTML
from PIL import Image
from starlette.requests import Request

from acquisition.motion.samples import Phase
from acquisition.processing.recording_tally import RecordingTally
from acquisition.recording.recording import Recording
from acquisition.runs.folder import RunFolder
from config.load import load_cell
from rid_daq.blocks.picture import Picture, PictureImage
from rid_daq.operations.payload.certified_session import certificate_of
from rid_daq.report.result import Result
from rid_daq.report_page.render import render_certificate, render_report
from rid_daq.report_page.run_robot import run_robot_blocks
from rid_daq.report_page.write import write_result
from rid_daq.service.refusals import UnknownError
from rid_daq.terminal.block_printer import print_blocks
from rid_daq.terminal.console import Console
from rid_daq.workbench.block_routes import View
from tests.builders.certified import certified_session
from tests.builders.invented import whole_result
from tests.builders.raised_codes import raises_code

MOST_BYTES = 600_000
IMAGE = re.compile(r'<img src="data:image/png;base64,([^"]+)" alt="([^"]+)"')


def run_of(root: Path, cell: str) -> RunFolder:
    folder = RunFolder.create(root, "run")
    for name, content in load_cell(cell).files.items():
        folder.write(name, content)
    return folder


def images_of(page: str) -> list[tuple[Image.Image, str]]:
    found: list[tuple[Image.Image, str]] = []
    for png, text in IMAGE.findall(page):
        image: Image.Image = Image.open(io.BytesIO(base64.b64decode(png)))
        image.load()
        found.append((image, text))
    return found


def pictures(folder: RunFolder, result: Result) -> list[Picture]:
    return [each for each in run_robot_blocks(folder, result) if isinstance(each, Picture)]


def started_at(position: float | None) -> Result:
    """Return a result whose first axis starts at a position [rad], and the other axes at 0."""
    document = whole_result()
    joints = load_cell("ir361").robot.joint_names
    axis = document["runs"][0]["axes"][0]
    document["runs"][0]["axes"] = [
        axis | {"joint": joint, "position_start": position if joint == "axis1" else 0.0}
        for joint in joints
    ]
    return Result.model_validate_json(json.dumps(document))


@pytest.mark.parametrize("cell", ["ir361", "kr15"])
def test_a_report_shows_four_views_and_stays_small(tmp_path: Path, cell: str) -> None:
    result = Result.new("Recording", cell)
    page = write_result(run_of(tmp_path, cell), result).read_text()
    images = images_of(page)
    assert [text.split(", ")[1] for _, text in images] == [
        *("oblique view", "front view", "side view", "top view"),
    ]
    assert len({image.size for image, _ in images}) == 1
    assert len(page) - len(render_report(result)) < MOST_BYTES
    assert not JustHTML(page, strict=True).errors


def test_a_payload_adds_views_of_the_flange(tmp_path: Path) -> None:
    session = certified_session(tmp_path)
    report = session.folder.file("report.html").read_text()
    certificate = render_certificate(certificate_of(session.folder, None))
    flange = [text for _, text in images_of(certificate)]
    assert [text.split(", ")[1] for text in flange] == [
        *("flange", "flange seen from +X", "flange seen from -Y", "flange seen from +Z"),
    ]
    assert "x 24.0, y 90.0, z \N{MINUS SIGN}202.0 mm" in certificate
    for page in (report, certificate):
        assert sum(len(png) for png, _ in IMAGE.findall(page)) < MOST_BYTES


def test_the_robot_is_drawn_at_the_start_of_the_motion(tmp_path: Path) -> None:
    folder = run_of(tmp_path, "ir361")
    zero, turned, unknown = (
        pictures(folder, started_at(position)) for position in (0.0, 1.0, None)
    )
    assert "start of the motion" in turned[0].caption
    assert "start of the motion" not in unknown[0].caption
    assert turned[0].images[0].png != zero[0].images[0].png
    assert unknown[0].images[0].png == zero[0].images[0].png


def test_the_start_is_the_first_valid_row_after_the_approach() -> None:
    position = np.arange(10.0).reshape(5, 2)
    valid = np.array([True, True, False, True, True])
    phase = np.array([Phase.APPROACH, Phase.APPROACH, *[Phase.MAIN] * 3], dtype=np.uint8)
    recording = Recording(
        joint_names=("a", "b"),
        time_s=np.arange(5.0),
        position=position,
        torque_nm=np.zeros((5, 2)),
        phase=phase,
        sample_index=np.array([-1, -1, 0, 1, 2]),
        valid=valid,
        source="cell",
    )
    approach, motion = recording.part(slice(0, 2)), recording.part(slice(2, 5))
    assert RecordingTally(approach).start is None
    tally = RecordingTally(approach)
    tally.add(motion)
    assert tally.start is not None
    assert tally.start.tolist() == [6.0, 7.0]


def test_a_schematic_shape_is_named_in_the_caption(tmp_path: Path) -> None:
    for cell, word in (("ir361", "SCHEMATIC"), ("kr15", "BODIES")):
        (picture,) = pictures(run_of(tmp_path / cell, cell), Result.new("Recording", cell))
        assert word in picture.caption


def test_a_changed_robot_file_is_not_drawn(tmp_path: Path) -> None:
    folder = run_of(tmp_path, "kr15")
    folder.file("robot.yaml").write_text("name: other\n")
    page = write_result(folder, Result.new("Recording", "kr15")).read_text()
    assert images_of(page) == []
    assert "robot.yaml was changed" in page


def test_a_run_without_a_robot_file_has_no_picture(tmp_path: Path) -> None:
    folder = RunFolder.create(tmp_path, "empty")
    assert list(run_robot_blocks(folder, Result.new("Recording", "kr15"))) == []


PICTURE = Picture(
    name="two",
    images=(PictureImage.of("one", 3, 2, b"png 1"), PictureImage.of("other", 3, 2, b"png 2")),
    caption="Two <views>.",
)


def test_a_console_shows_the_caption_in_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    print_blocks([PICTURE], Console())
    assert capsys.readouterr().out == "Picture: Two <views>.\n"


def test_a_page_gets_texts_first_and_each_image_by_its_number() -> None:
    request = Request({"type": "http", "headers": []})
    (document,) = json.loads(bytes(View(request).answer([PICTURE]).body))
    assert document["caption"] == "Two <views>."
    assert [each["number"] for each in document["images"]] == [0, 1]
    assert "png" not in document["images"][0]
    answer = View(request, image=1).answer([PICTURE, PICTURE])
    assert (bytes(answer.body), answer.media_type) == (b"png 2", "image/png")
    with raises_code(UnknownError, "RID-RUN-FILE", "4"):
        View(request, image=4).answer([PICTURE, PICTURE])
