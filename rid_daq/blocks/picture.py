"""`Picture`: still images side by side, such as views of a robot."""

from __future__ import annotations

import base64
from typing import Annotated, Literal

from pydantic import Field, Strict

from config.model import ConfigModel


class PictureImage(ConfigModel):
    """One image.

    Attributes:
        text: Content of the image in words, for readers who cannot see it.
        width, height: Size [px].
        png: The image as PNG, in base64.
    """

    text: str
    width: Annotated[int, Field(gt=0)]
    height: Annotated[int, Field(gt=0)]
    png: str

    @classmethod
    def of(cls, text: str, width: int, height: int, png: bytes) -> PictureImage:
        """Return an image from the bytes of a PNG."""
        return cls(text=text, width=width, height=height, png=base64.b64encode(png).decode())

    def read(self) -> bytes:
        """Return the bytes of the PNG."""
        return base64.b64decode(self.png)


class Picture(ConfigModel):
    """Still images side by side. A renderer that shows no images shows the caption.

    Attributes:
        name: Base name of its files.
        images: The images, row by row.
        caption: Explanation for the reader.
    """

    kind: Literal["picture"] = "picture"
    name: str
    images: Annotated[tuple[PictureImage, ...], Strict(False)]
    caption: str

    @property
    def line(self) -> str:
        """Line that replaces the picture on a console."""
        return f"Picture: {self.caption}"
