"""Drawn robots in a browser: a pinhole camera of our own, markers, and differences of pictures.

The view is the element `#view` of a page; its property `robotView` is the object of
`robot_view.js`.
"""

from __future__ import annotations

import base64
import io
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from PIL import Image
from playwright.sync_api import Page

from rid_daq.robot_view.scene import RobotScene
from rid_daq.robot_view.scene_encoding import encode_scene

WEBGL: Final = (
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
)
"""Options with which Chromium draws 3-D pictures without a graphics card."""

MARKER_PX: Final = 6.0
VISIBLE: Final = 12

_DRAWN = """() => {
  const { drawing } = document.getElementById('view').robotView;
  return new Promise((done) => {
    const check = () => requestAnimationFrame(drawing.isWaiting ? check : () => done(null));
    check();
  });
}"""
_READY = "() => document.getElementById('view')?.robotView?.drawing?.frames > 0"
_OPEN = """async ({ scene, binary, position }) => {
  const bytes = Uint8Array.from(atob(binary), (each) => each.charCodeAt(0)).buffer;
  const view = document.getElementById('view').robotView;
  view.pose = { position, target: null };
  await view.open(scene, bytes);
}"""
_SHOW = """(position) => {
  const view = document.getElementById('view').robotView;
  view.show({ position, words: 'a test', kind: 'planned' });
}"""
_POINTS = """(poses) => {
  const { drawing } = document.getElementById('view').robotView;
  const { camera, arm, canvas } = drawing;
  return poses.map((position) => {
    drawing.show(position, null);
    const points = [...arm.links, arm.tool].map((frame) => {
      const at = camera.target.clone().setFromMatrixPosition(frame.matrixWorld).project(camera.eye);
      return [
        ((at.x + 1) / 2) * canvas.clientWidth,
        ((1 - at.y) / 2) * canvas.clientHeight,
      ];
    });
    return { points, eye: camera.eye.position.toArray(), target: camera.target.toArray(),
      field_deg: camera.eye.fov, width: canvas.clientWidth, height: canvas.clientHeight };
  });
}"""
_MARK = """async ({ link, radius }) => {
  const { Mesh, MeshLambertMaterial, SphereGeometry } = await import('/static/three.js');
  const { drawing } = document.getElementById('view').robotView;
  const { arm, stage } = drawing;
  drawing.marker?.removeFromParent();
  const material = new MeshLambertMaterial({ color: '#000000', emissive: '#ff00ff' });
  drawing.marker = new Mesh(new SphereGeometry(radius, 24, 16), material);
  [...arm.links, arm.tool][link].add(drawing.marker);
  stage.traverse((each) => {
    if (each.isMesh || each.isLine) each.visible = each === drawing.marker;
  });
  drawing.labels.place.hidden = true;
  drawing.draw();
}"""


@dataclass(frozen=True)
class Pinhole:
    """A pinhole camera that looks at a point, with z up.

    Attributes:
        eye, target: Shape (3,). Position of the camera, and the point that it looks at [m].
        field_deg: Vertical field of view.
        size_px: Width and height of the picture.
    """

    eye: np.ndarray
    target: np.ndarray
    field_deg: float
    size_px: tuple[float, float]

    @classmethod
    def of(cls, found: dict[str, Any]) -> Pinhole:
        """Return the camera with which a page has drawn its picture."""
        size = found["width"], found["height"]
        return cls(np.array(found["eye"]), np.array(found["target"]), found["field_deg"], size)

    def project(self, points: np.ndarray) -> np.ndarray:
        """Return the pixel coordinates, (k, 2), of points [m], (k, 3), in a frame with z up."""
        back = (self.eye - self.target) / np.linalg.norm(self.eye - self.target)
        right = np.cross([0.0, 0.0, 1.0], back)
        right /= np.linalg.norm(right)
        x, y, z = np.array([right, np.cross(back, right), back]) @ (points - self.eye).T
        width, height = self.size_px
        focal = height / 2 / np.tan(np.radians(self.field_deg) / 2)
        return np.column_stack([width / 2 - focal * x / z, height / 2 + focal * y / z])


def wait_for_picture(page: Page) -> None:
    """Wait until the view has drawn a picture.

    The content security policy of the pages forbids `wait_for_function`.
    """
    for _ in range(600):
        if page.evaluate(_READY):
            return
        page.wait_for_timeout(100)
    raise AssertionError("the view has drawn nothing within 60 s")


def wait_until_drawn(page: Page) -> None:
    """Wait until the view shows its newest picture, which waits for the one before."""
    page.evaluate(_DRAWN)


def open_scene(page: Page, scene: RobotScene, position: np.ndarray) -> None:
    """Show another scene in the page's view, in a pose [rad or m]."""
    document, binary = encode_scene(scene, "/of/a/test", "small")
    encoded = base64.b64encode(binary).decode()
    scene_document = document.model_dump(mode="json")
    page.evaluate(
        _OPEN, {"scene": scene_document, "binary": encoded, "position": position.tolist()}
    )
    show_pose(page, position)


def show_pose(page: Page, position: np.ndarray) -> None:
    """Show a pose [rad or m], and wait until it is drawn."""
    page.evaluate(_SHOW, position.tolist())
    wait_until_drawn(page)


def drawn_points(page: Page, poses: np.ndarray) -> list[tuple[np.ndarray, Pinhole]]:
    """Return the pixel coordinates of the frames and the camera for each pose [rad or m].

    The frames are those of the base, the links and the tool.
    """
    found = page.evaluate(_POINTS, poses.tolist())
    return [(np.array(each["points"]), Pinhole.of(each)) for each in found]


def marker_place(page: Page, link: int, radius_m: float) -> np.ndarray:
    """Draw only a ball at a frame, and return the pixel coordinates of its centre.

    `link` counts the frames of `drawn_points` from 0; the last is the tool.
    """
    page.evaluate(_MARK, {"link": link, "radius": radius_m})
    wait_until_drawn(page)
    picture = picture_of(page)
    is_marker = (picture[..., 0] > 200) & (picture[..., 1] < 60) & (picture[..., 2] > 200)
    rows, columns = np.nonzero(is_marker)
    return np.array([columns.mean() + 0.5, rows.mean() + 0.5])


def picture_of(page: Page) -> np.ndarray:
    """Return the view's picture without its border: RGB values, (rows, columns, 3)."""
    shot = page.locator("#view .view-picture canvas").screenshot()
    return np.asarray(Image.open(io.BytesIO(shot)).convert("RGB")).astype(int)


def changed_share(one: np.ndarray, other: np.ndarray) -> float:
    """Return the share of pixels that differ by more than 12 of 255 in a colour."""
    return float((np.abs(one - other).max(axis=2) > VISIBLE).mean())
