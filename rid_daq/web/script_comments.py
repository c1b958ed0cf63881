"""`without_comments`: a script of the pages as it is sent, without comments and types."""

from __future__ import annotations

import re
from typing import Final

_COMMENT: Final = re.compile(r"/\*\*[\s\S]*?\*/ ?|^[ \t]*//[^\n]*", re.MULTILINE)


def without_comments(script: str) -> str:
    """Return a script without its JSDoc comments and its lines that are comments.

    Each line keeps its number, so that a browser names the lines of our source files. No string of
    our scripts may contain the beginning of such a comment.
    """
    return _COMMENT.sub(lambda found: "\n" * found[0].count("\n"), script)
