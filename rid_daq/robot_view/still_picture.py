"""`still_views`: still pictures of a robot as PNG."""

from __future__ import annotations

import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from config.arrays import FloatArray
from config.meshes.mesh import Mesh
from rid_daq.robot_view.link_shapes import ShapeKind
from rid_daq.robot_view.rasterizer import OUTLINE, Canvas
from rid_daq.robot_view.scene import RobotScene
from rid_daq.robot_view.sharp_edges import split_at_edges
from rid_daq.robot_view.solids import arrow_mesh
from rid_daq.robot_view.still_parts import Label, StillParts, flange_parts, still_parts

WIDTH_PX: Final = 700
VIEWS: Final[Mapping[str, tuple[float, float, float]]] = {
    "oblique view": (1.0, -1.15, 0.62),
    "front view": (1.0, 0.0, 0.0),
    "side view": (0.0, -1.0, 0.0),
    "top view": (0.0, 0.0, 1.0),
}
"""Directions towards the viewer in the view's frame, in which gravity points along -z."""

FLANGE_VIEWS: Final[Mapping[str, tuple[float, float, float]]] = {
    "flange": (1.0, -1.15, 0.62),
    "flange seen from +X": (1.0, 0.0, 0.0),
    "flange seen from -Y": (0.0, -1.0, 0.0),
    "flange seen from +Z": (0.0, 0.0, 1.0),
}
"""Directions towards the viewer in the flange's frame."""

SHAPE_WORDS: Final[Mapping[ShapeKind, str]] = {
    "meshes": "MESHES",
    "bodies": "BODIES",
    "schematic": "SCHEMATIC",
}

_INK: Final = tuple(map(int, OUTLINE))
GRAVITY: Final = (190.0, 70.0, 20.0)

_FILLED_PX: Final = (560.0, 540.0)
"""Largest width and height of the robot in a picture [px]."""

_COLOURS: Final = 255
"""Colours of a picture; a palette makes the file three times smaller."""

_COMPRESSION: Final = 6
"""Level 9 takes five times as long for files that are 7 % smaller."""

_AROUND_PX: Final = 150
_LEAST_HEIGHT_PX: Final = 420


@dataclass(frozen=True, eq=False)
class Still:
    """A still picture.

    Attributes:
        title: The view.
        width, height: Size [px].
        png: The picture.
    """

    title: str
    width: int
    height: int
    png: bytes


@dataclass(frozen=True, eq=False)
class _Camera:
    """Parallel projection of the view's frame into a picture.

    Attributes:
        turn: Shape (3, 3). Rows: right, up, towards the viewer.
        middle: Shape (3,). Point at the middle of the picture, in the rows' directions [m].
        pixels_per_m: Scale.
        height_px: Height of the picture [px].
    """

    turn: FloatArray
    middle: FloatArray
    pixels_per_m: float
    height_px: int

    def project(self, points: FloatArray) -> FloatArray:
        """Return the picture's coordinates of points, (points, 3) [px]; z towards the viewer."""
        scale = self.pixels_per_m * np.array([1.0, -1.0, 1.0])
        return (points @ self.turn.T - self.middle) * scale + [
            WIDTH_PX / 2,
            self.height_px / 2,
            0.0,
        ]


def rest_pose(scene: RobotScene) -> FloatArray:
    """Return the pose with all joints at zero, or at the limit that is closest to zero."""
    limits = np.array([joint.limits for joint in scene.joints])
    return np.asarray(np.clip(0.0, limits[:, 0], limits[:, 1]))


def still_views(scene: RobotScene, q: FloatArray) -> tuple[Still, ...]:
    """Return four views of a robot, all to the same scale.

    Equal scenes and poses give equal bytes.

    Args:
        scene: The scene.
        q: Shape (n,). Joint positions [rad or m].
    """
    falls = bool(np.any(scene.gravity_m_s2))
    return _views(still_parts(scene, q), VIEWS, SHAPE_WORDS[scene.shape], falls=falls)


def flange_views(scene: RobotScene) -> tuple[Still, ...]:
    """Return four views of the flange with its frame and the payload's centre of gravity."""
    return _views(flange_parts(scene), FLANGE_VIEWS, SHAPE_WORDS[scene.shape], falls=False)


def _views(
    parts: StillParts, views: Mapping[str, tuple[float, float, float]], words: str, *, falls: bool
) -> tuple[Still, ...]:
    """Return views to the same scale.

    Args:
        parts: Parts and labels.
        views: Title of each view, and direction towards the viewer.
        words: Text that states the origin of the robot's shape.
        falls: True to show the direction of gravity, which is -z.
    """
    turns = {title: _turn(np.array(back)) for title, back in views.items()}
    extents = {title: _extent(parts, turn) for title, turn in turns.items()}
    size = np.max([(most - least)[:2] for least, most in extents.values()], axis=0)
    scale = float(np.min(_FILLED_PX / size))
    height = max(_LEAST_HEIGHT_PX, int(scale * size[1]) + _AROUND_PX)
    cameras = {
        title: _Camera(turn, 0.5 * np.add(*extents[title]), scale, height)
        for title, turn in turns.items()
    }
    return tuple(
        Still(title, WIDTH_PX, height, _picture(parts, camera, (title, words), falls=falls))
        for title, camera in cameras.items()
    )


def join_stills(stills: Sequence[Still]) -> bytes:
    """Return pictures of equal size as one PNG, two in a row."""
    width, height = stills[0].width, stills[0].height
    rows = (len(stills) + 1) // 2
    whole = Image.new("RGB", (2 * width, rows * height), "white")
    for number, still in enumerate(stills):
        place = (number % 2) * width, (number // 2) * height
        whole.paste(Image.open(io.BytesIO(still.png)).convert("RGB"), place)
    return _png(whole)


def _png(image: Image.Image) -> bytes:
    packed = io.BytesIO()
    few = image.quantize(_COLOURS, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    few.save(packed, "PNG", compress_level=_COMPRESSION)
    return packed.getvalue()


def _turn(back: FloatArray) -> FloatArray:
    back = back / np.linalg.norm(back)
    right = np.cross([0.0, 1.0, 0.0] if abs(back[2]) > 0.99 else [0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    return np.array([right, np.cross(back, right), back])


def _extent(parts: StillParts, turn: FloatArray) -> tuple[FloatArray, FloatArray]:
    points = np.concatenate([part.mesh.vertices_m for part in parts.parts]) @ turn.T
    return points.min(axis=0), points.max(axis=0)


def _picture(parts: StillParts, camera: _Camera, texts: tuple[str, str], *, falls: bool) -> bytes:
    canvas = Canvas(WIDTH_PX, camera.height_px)
    for part in parts.parts:
        canvas.draw(
            Mesh(camera.project(part.mesh.vertices_m), part.mesh.triangles),
            part.normals @ camera.turn.T,
            part.colour,
            in_front=part.in_front,
        )
    if falls:
        _draw_gravity(canvas, camera)
    image = Image.fromarray(canvas.pixels())
    pen = ImageDraw.Draw(image)
    title, words = texts
    pen.text((14, 10), title, _INK, ImageFont.load_default(28))
    pen.text((WIDTH_PX - 14, 10), words, _INK, ImageFont.load_default(28), anchor="ra")
    if falls:
        away = " (away from you)" if camera.turn[2, 2] > 0.99 else ""
        pen.text(
            (20, camera.height_px - 14), f"gravity{away}", _INK, ImageFont.load_default(22), "lb"
        )
    _draw_scale_bar(pen, camera)
    _draw_labels(pen, camera, parts.labels)
    return _png(image)


def _draw_gravity(canvas: Canvas, camera: _Camera) -> None:
    """Draw an arrow along gravity in the lower left corner."""
    along = camera.turn @ [0.0, 0.0, -1.0] * [1.0, -1.0, 1.0]
    middle = np.array([50.0, camera.height_px - 98.0, 0.0])
    mesh, normals = split_at_edges(arrow_mesh(middle - 46.0 * along, middle + 46.0 * along, 5.0))
    canvas.draw(mesh, normals, np.array(GRAVITY), in_front=True)


def _draw_scale_bar(pen: ImageDraw.ImageDraw, camera: _Camera) -> None:
    """Draw a bar of a round length, at most a quarter of the picture."""
    longest = 0.25 * WIDTH_PX / camera.pixels_per_m
    steps = [m * 10.0**e for e in range(-4, 3) for m in (1.0, 2.0, 5.0)]
    length = max(step for step in steps if step <= longest)
    right, y = WIDTH_PX - 16, camera.height_px - 16
    left = right - length * camera.pixels_per_m
    pen.line([(left, y - 6), (left, y), (right, y), (right, y - 6)], _INK, 2)
    text = f"{length:g} m" if length >= 1.0 else f"{1e3 * length:g} mm"
    pen.text(((left + right) / 2, y - 4), text, _INK, ImageFont.load_default(22), "mb")


def _draw_labels(pen: ImageDraw.ImageDraw, camera: _Camera, labels: Sequence[Label]) -> None:
    """Draw the labels, if possible without overlaps; a line leads to a label that was moved."""
    font = ImageFont.load_default(22)
    bottom = camera.height_px
    taken: list[tuple[float, float, float, float]] = [
        (0, 0, WIDTH_PX, 44),
        (0, bottom - 52, WIDTH_PX, bottom),
        (0, bottom - 150, 100, bottom),
    ]
    lines, texts = [], []
    for label in labels:
        wide, high = 0.5 * pen.textlength(label.text, font) + 2.0, 13.0
        start, tip = camera.project(np.array([label.start, label.place]))[:, :2]
        along = (tip - start) / max(float(np.linalg.norm(tip - start)), 1.0)
        x, y = (tip + along * [wide + 3.0, high + 3.0]).tolist()
        at = _free_place((x, y), (wide, high), taken)
        taken.append((at[0] - wide, at[1] - high, at[0] + wide, at[1] + high))
        if abs(at[0] - x) > wide or abs(at[1] - y) > high:
            lines.append((*tip.tolist(), at))
        texts.append((at, label.text))
    for x, y, at in lines:
        pen.line([(x, y), at], (120, 128, 136), 1)
    for at, text in texts:
        pen.text(at, text, _INK, font, "mm", stroke_width=2, stroke_fill="white")


def _free_place(
    wanted: tuple[float, float],
    half: tuple[float, float],
    taken: Sequence[tuple[float, float, float, float]],
) -> tuple[float, float]:
    """Return the middle of the free place closest to the wanted one, or this one if none is free.

    Args:
        wanted: Wanted middle of the label [px].
        half: Half width and half height of the label [px].
        taken: Left, top, right and bottom of each place that is not free [px].
    """
    (x, y), (wide, high) = wanted, half
    for reach in range(0, WIDTH_PX, 12):
        for turn in range(1 if reach == 0 else 16):
            angle = 2.0 * math.pi * turn / 16
            u = min(max(x + reach * math.cos(angle), wide), WIDTH_PX - wide)
            v = y + reach * math.sin(angle)
            if all(
                u + wide <= left or u - wide >= right or v + high <= top or v - high >= bottom
                for left, top, right, bottom in taken
            ):
                return u, v
    return x, y
