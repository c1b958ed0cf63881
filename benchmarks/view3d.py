"""The 3-D view in a browser without a graphics card: accuracy, first picture, bytes, frame rate.

`python -m benchmarks.view3d` serves the bundled six-axis cell, opens its page in Chromium, and
prints one JSON document. The frame rate depends on other load: the document contains it, and the
processor time per frame of all processes of the browser.
"""

from __future__ import annotations

import gzip
import json
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import pinocchio as pin
from playwright.sync_api import Page, sync_playwright

from config.load import load_robot
from config.meshes.mesh import Mesh
from rid_daq.robot_view.scene import RobotScene
from rid_daq.robot_view.scene_encoding import encode_scene
from tests.builders.browser_drawing import (
    WEBGL,
    drawn_points,
    marker_place,
    open_scene,
    show_pose,
    wait_for_picture,
)
from tests.rid_daq.robot_view.test_scene import ROBOTS, pinocchio_of, poses
from tests.rid_daq.service.conftest import serving

POSES: Final = 200
MARKED_POSES: Final = 4
TRIANGLES: Final = 10_000
PLAYED_S: Final = 5.0
TICK_S: Final = os.sysconf("SC_CLK_TCK")
LIMITS: Final = {
    "largest error, drawn [px]": 1.0,
    "first picture [s]": 2.0,
    "transferred [kB]": 300.0,
}
LEAST_FRAMES_PER_S: Final = 20.0

_FIRST = """() => {
  const entries = performance.getEntriesByType('resource');
  const all = [...performance.getEntriesByType('navigation'), ...entries];
  const is_view = ({ name }) => /three|robot_|drawing_|view|joint_rows|live_pose/.test(name);
  const size = (list) => list.reduce((sum, each) => sum + each.transferSize, 0) / 1000;
  const triangles = entries.filter(({ name }) => name.includes('/triangles/'));
  const sizes = { transferred: size(all), view: size(entries.filter(is_view)) };
  return { ...sizes, triangles: size(triangles) };
}"""
_PLAY = """async ({ poses, seconds }) => {
  const view = document.getElementById('view').robotView;
  const { drawing } = view;
  const first = drawing.frames;
  const begin = performance.now();
  for (let i = 0; performance.now() - begin < 1000 * seconds; i += 1) {
    view.show({ position: poses[i % poses.length], words: 'a benchmark', kind: 'planned' });
    await new Promise((done) => requestAnimationFrame(done));
    const gl = drawing.renderer.getContext();
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
  }
  return (drawing.frames - first) / ((performance.now() - begin) / 1000);
}"""


def measure() -> dict[str, Any]:
    """Return all figures."""
    chromium = shutil.which("chromium-headless-shell") or shutil.which("chromium")
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as driver:
        options = ["--no-sandbox", "--no-first-run", "--disable-background-networking", *WEBGL]
        browser = driver.chromium.launch(executable_path=chromium, args=options)
        with serving(Path(folder), cell="kr15") as served:
            warm = browser.new_context(viewport={"width": 1280, "height": 900})
            warm.new_page().goto(served.url)  # the service's first answer includes its imports
            warm.close()
            context = browser.new_context(viewport={"width": 1280, "height": 900})
            page = context.new_page()
            page.goto(served.url.split("?")[0])
            figures: dict[str, Any] = {"load before": os.getloadavg()[0]}
            begin_s = time.monotonic()
            page.goto(served.url, wait_until="commit")
            wait_for_picture(page)
            figures["first picture [s]"] = time.monotonic() - begin_s
            sizes = page.evaluate(_FIRST)
            served_kb = sizes["transferred"] - sizes["triangles"]
            figures["scripts and scene of the view [kB]"] = sizes["view"] - sizes["triangles"]
            page.evaluate("document.querySelector('footer').hidden = true")
            figures |= frame_rate(page)
            figures["transferred [kB]"] = served_kb + figures["compressed triangles [kB]"]
            figures["accuracy"] = {name: accuracy(page, name) for name in ROBOTS}
        browser.close()
    errors = [each["drawn [px]"] for each in figures["accuracy"].values()]
    figures["largest error, drawn [px]"] = max(errors)
    met = [figures[name] <= limit for name, limit in LIMITS.items()]
    figures["limits hold"] = all(met) and figures["frames per second"] >= LEAST_FRAMES_PER_S
    return figures


def accuracy(page: Page, name: str) -> dict[str, float]:
    """Return the largest distances between drawn frames and Pinocchio's kinematics [px]."""
    robot = load_robot(name)
    scene = RobotScene.of(robot)
    model, tool = pinocchio_of(robot)
    data = model.createData()
    tried = poses(scene, POSES)
    open_scene(page, scene, tried[0])
    computed = drawn = 0.0
    for number, (q, (points, camera)) in enumerate(
        zip(tried, drawn_points(page, tried), strict=True)
    ):
        pin.forwardKinematics(model, data, q)
        places = [*data.oMi, data.oMi[-1] * tool]
        upright = np.array([place.translation for place in places]) @ scene.upright.T
        computed = max(computed, float(np.abs(points - camera.project(upright)).max()))
        if number >= MARKED_POSES:
            continue
        show_pose(page, q)
        seen = drawn_points(page, q[np.newaxis])[0][1].project(upright)
        for link in range(1, len(upright)):
            error = np.linalg.norm(marker_place(page, link, 0.02) - seen[link])
            drawn = max(drawn, float(error))
    return {"poses": POSES, "computed [px]": computed, "drawn [px]": drawn}


def frame_rate(page: Page) -> dict[str, float]:
    """Return the rate at which a moving robot of `TRIANGLES` triangles is drawn."""
    scene = RobotScene.of(load_robot("kr15"))
    fine = refined(scene.links, TRIANGLES)
    scene = replace(scene, links=fine, small_links=fine)
    moving = poses(scene, 100)
    open_scene(page, scene, moving[0])
    before_s = browser_time_s()
    rate = float(page.evaluate(_PLAY, {"poses": moving.tolist(), "seconds": PLAYED_S}))
    used_s = browser_time_s() - before_s
    _, binary = encode_scene(scene, "/of/a/benchmark", "small")
    return {
        "triangles": sum(len(link.triangles) for link in fine),
        "compressed triangles [kB]": len(gzip.compress(binary, 6)) / 1e3,
        "frames per second": rate,
        "processor time per frame [ms]": 1e3 * used_s / (rate * PLAYED_S),
        "load during": os.getloadavg()[0],
    }


def refined(links: tuple[Mesh, ...], triangles: int) -> tuple[Mesh, ...]:
    """Return the links with their triangles cut into four until there are `triangles` or more.

    The surplus is left out at the last link.
    """
    while sum(len(link.triangles) for link in links) < triangles:
        links = tuple(cut_in_four(link) for link in links)
    surplus = sum(len(link.triangles) for link in links) - triangles
    fine = []
    for link in reversed(links):
        left_out = min(surplus, len(link.triangles) - 1)
        surplus -= left_out
        fine.append(Mesh(link.vertices_m, link.triangles[left_out:]))
    return tuple(reversed(fine))


def cut_in_four(mesh: Mesh) -> Mesh:
    """Return a mesh with new corners in the middle of all edges."""
    a, b, c = (mesh.corners_m[:, corner] for corner in range(3))
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    corners = np.concatenate([np.stack(part, axis=1) for part in parts]).reshape(-1, 3)
    vertices, numbers = np.unique(corners.round(7), axis=0, return_inverse=True)
    return Mesh(vertices, numbers.reshape(-1, 3))


def browser_time_s() -> float:
    """Return the processor time that all processes of the browser have used [s]."""
    return sum(_times_s(os.getpid(), "chrom"))


def _times_s(pid: int, name: str) -> Iterator[float]:
    """Yield the processor times of a process's descendants with a name [s]."""
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            head, _, rest = path.read_text().rpartition(")")
        except OSError:  # the process has ended
            continue
        fields = rest.split()
        if int(fields[1]) != pid:
            continue
        if name in head:
            yield (int(fields[11]) + int(fields[12])) / TICK_S
        yield from _times_s(int(path.parent.name), name)


if __name__ == "__main__":
    json.dump(measure(), sys.stdout, indent=2)
    sys.stdout.write("\n")
