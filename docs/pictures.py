"""Take the pictures of reports and workbench: `python docs/pictures.py [FOLDER]`.

The program runs commands of the tutorials on simulated cells in a temporary folder. Debian's
chromium takes the pictures, in the light theme and 960 pixels wide. FOLDER (default:
`build/pictures`) receives pictures of the reports and of every page of the workbench;
`docs/pictures` receives those that the guides show. This takes some minutes. If the environment
variable `RID_DAQ_SCREENSHOTS` names a folder, the tests also store pictures of every page of the
workbench there, at three widths, light and dark.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final, NamedTuple

from playwright.sync_api import Browser, Locator, ViewportSize, sync_playwright

from rid_daq.workbench.menu import MENU

DOCS: Final = Path(__file__).resolve().parent
GUIDE_PICTURES: Final = DOCS / "pictures"
LARGEST_BYTES: Final = 150_000
PROGRAM: Final = (sys.executable, "-P", "-m", "rid_daq")
FLAGS: Final = (
    *("--no-sandbox", "--no-first-run", "--ignore-gpu-blocklist"),
    *("--use-angle=swiftshader", "--enable-unsafe-swiftshader"),
)
"""Options of Chromium that draw 3-D pictures without a graphics card."""

PAGE: Final[ViewportSize] = {"width": 960, "height": 640}
WORKBENCH: Final[ViewportSize] = {"width": 960, "height": 900}

FAULT: Final = "drives: [{kind: reversed, joint: axis2, at_cycle: 400}]\n"
COMMANDS: Final = (
    ("demo", 0),
    ("design ir361 -o other.yaml --period 4 --periods 3 --seed 2", 0),
    ("record ir361 other.yaml --label stopped --faults fault.yaml", 5),
    ("design ir361 --kind constant-velocity -o steady.yaml", 0),
    ("record ir361 steady.yaml --label steady", 0),
    ("friction steady", 0),
    ("plate zero ir361 --label zero", 0),
    ("payload kr15 --payload medium --label payload --periods 3 --warm-up 2 --yes", 0),
)
"""Commands that run in the temporary folder, with their expected exit codes."""


class Shot(NamedTuple):
    """A part of a report of which a separate picture is taken.

    Attributes:
        run: Label of the run.
        plot: Kind of the plot that the picture shows.
        height_px: Height of the picture, from the top of the plot; 0 for the whole plot.
    """

    run: str
    plot: str
    height_px: int = 0


SHOTS: Final = {
    "fit": Shot("demo", "fit", 422),
    "path": Shot("demo", "path", 392),
    "spectrum": Shot("demo", "spectrum"),
    "friction": Shot("steady", "friction"),
    "stop": Shot("stopped", "stop"),
    "centre": Shot("payload", "centre"),
}
REPORTS: Final = ("demo", "stopped", "steady", "zero", "payload")
GUIDES: Final = ("fit", "path", "stop", "centre", "friction", "workbench")
"""Pictures in `docs/pictures`, shown by README, index and guides."""


def take(folder: Path) -> None:
    """Take all pictures into a folder, and copy those of the guides into `docs/pictures`."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="rid-daq-pictures-") as scratch:
        work = Path(scratch)
        (work / "fault.yaml").write_text(FAULT, encoding="utf-8")
        for words, code in COMMANDS:
            print(f"$ rid-daq {words}", flush=True)  # noqa: T201
            found = subprocess.call([*PROGRAM, *words.split()], cwd=work, stdout=subprocess.DEVNULL)
            if found != code:
                raise SystemExit(f"rid-daq {words}: exit code {found}, expected {code}")
        with chromium() as browser:
            take_reports(browser, work, folder)
            take_workbench(browser, work, folder)
    GUIDE_PICTURES.mkdir(exist_ok=True)
    for name in GUIDES:
        size = (folder / f"{name}.png").stat().st_size
        if size > LARGEST_BYTES:
            raise SystemExit(f"{name}.png has {size} bytes; the limit is {LARGEST_BYTES}")
        shutil.copy(folder / f"{name}.png", GUIDE_PICTURES)


def take_reports(browser: Browser, work: Path, folder: Path) -> None:
    """Take a picture of each report, and of the plots in `SHOTS`."""
    page = browser.new_page(viewport=PAGE)
    for run in REPORTS:
        page.goto(report_of(work / "runs", run).as_uri())
        for place in page.locator("[data-plot]").all():
            place.scroll_into_view_if_needed()
            place.locator('.live[data-figure-state="shown"]').wait_for()
        page.evaluate("scrollTo(0, 0)")
        (folder / f"report-{run}.png").write_bytes(page.screenshot(full_page=True))
        for name, shot in SHOTS.items():
            if shot.run == run:
                plot = page.locator(f'[data-plot^="{shot.plot}-"]').first
                place = plot.locator(".live > div").last
                (folder / f"{name}.png").write_bytes(picture_of(place, shot.height_px))


def take_workbench(browser: Browser, work: Path, folder: Path) -> None:
    """Take a picture of every page of a cell's workbench."""
    words = "serve ir361 --listen 127.0.0.1:0 --json"
    with subprocess.Popen(
        [*PROGRAM, *words.split()],
        cwd=work,
        stdout=subprocess.PIPE,
        text=True,
        env={
            **os.environ,
            "XDG_STATE_HOME": str(work / "state"),
        },  # without the last pose of other sessions
    ) as service:
        assert service.stdout is not None
        output = ""
        while not output.endswith("}\n"):
            output += service.stdout.readline()
        try:
            page = browser.new_page(viewport=WORKBENCH)
            url = json.loads(output)["url"]
            page.goto(url)
            for entry in MENU:
                page.goto(f"{url.split('/?')[0]}/cells/ir361{entry.path}")
                page.locator("#lease-take").wait_for()
                page.wait_for_load_state("networkidle")
                if not entry.path:
                    page.locator("#view .view-tools button").first.wait_for()  # the robot is drawn
                name = entry.path.strip("/").replace("/", "-") or "cell"
                (folder / f"page-{name}.png").write_bytes(page.screenshot(full_page=True))
                if not entry.path:
                    (folder / "workbench.png").write_bytes(page.screenshot())
        finally:
            service.send_signal(signal.SIGTERM)


def picture_of(place: Locator, height_px: int) -> bytes:
    """Return a picture of a part of a page, or of the top `height_px` pixels of this part."""
    place.scroll_into_view_if_needed()
    box = place.bounding_box()
    assert box is not None
    scroll = place.page.evaluate("scrollY")
    height = min(box["height"], height_px or box["height"])
    return place.page.screenshot(
        full_page=True,
        clip={"x": box["x"], "y": box["y"] + scroll, "width": box["width"], "height": height},
    )


def report_of(runs: Path, label: str) -> Path:
    """Return the report of the run with a label."""
    for manifest in runs.glob("*/manifest.json"):
        if json.loads(manifest.read_text(encoding="utf-8"))["label"] == label:
            return manifest.with_name("report.html")
    raise SystemExit(f"{runs}: no run {label!r}")


@contextmanager
def chromium() -> Iterator[Browser]:
    """Start Debian's chromium."""
    path = shutil.which("chromium")
    if path is None:
        raise SystemExit("chromium is needed; on Debian: apt install chromium")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=list(FLAGS))
        yield browser
        browser.close()


if __name__ == "__main__":
    take(Path(sys.argv[1]) if len(sys.argv) > 1 else DOCS.parent / "build" / "pictures")
