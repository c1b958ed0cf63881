"""`CompressedBody`: body of an answer, sent in gzip if the client accepts it."""

from __future__ import annotations

import gzip
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from starlette.requests import Request
from starlette.responses import Response

_LEVEL: Final = 6
LARGEST_LEVEL: Final = 9
"""Level for bodies that are compressed once and sent often."""


@dataclass(frozen=True)
class CompressedBody:
    """A body, uncompressed and in gzip.

    Attributes:
        plain: The body.
        gzipped: The body in gzip.
    """

    plain: bytes
    gzipped: bytes

    @classmethod
    def of(cls, plain: bytes, level: int = _LEVEL) -> CompressedBody:
        """Compress a body, with a level of gzip."""
        return cls(plain, gzip.compress(plain, level, mtime=0))

    def answer(
        self, request: Request, media_type: str, headers: Mapping[str, str] | None = None
    ) -> Response:
        """Return the answer to a request, in an encoding that the client accepts.

        Args:
            request: The request with its header `Accept-Encoding`.
            media_type: Media type of the body.
            headers: Other headers of the answer.
        """
        named = {**(headers or {}), "vary": "accept-encoding"}
        accepted = request.headers.get("accept-encoding", "").lower().split(",")
        if "gzip" in (each.strip() for each in accepted):
            named["content-encoding"] = "gzip"
            return Response(self.gzipped, media_type=media_type, headers=named)
        return Response(self.plain, media_type=media_type, headers=named)
