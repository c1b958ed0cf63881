"""`docs`: open the documentation that is installed with the program, or explain an error code."""

from __future__ import annotations

import difflib
import webbrowser
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

from pydantic import Field

from config.error_codes import ErrorCode, declared_codes
from config.errors import ConfigError
from rid_daq.blocks.block import Heading, Text
from rid_daq.operations.operation import Context, Operation
from rid_daq.requests.option import Option
from rid_daq.requests.request import Request

SITE: Final = Path(__file__).resolve().parents[2] / "site"


class DocsRequest(Request):
    """Open the documentation in the browser, or explain an error code. It needs no internet."""

    topic: Annotated[
        str | None,
        Field(
            description="Page to open, such as `payload`, `faults` or the number of a decision;"
            " or an error code, such as RID-FILE-READ (default: the start page)."
        ),
        Option(positional=True, metavar="[TOPIC]"),
    ] = None
    open: Annotated[
        bool,
        Field(description="Open the browser; otherwise only print the address."),
        Option(negatable=True),
    ] = True


@dataclass(frozen=True)
class DocsResult:
    """A page of the documentation.

    Attributes:
        is_shown: False if no browser could be opened.
    """

    page: Path
    is_shown: bool

    def document(self) -> dict[str, object]:
        """Return the path of the page."""
        return {"page": str(self.page)}

    def blocks(self) -> Iterator[Text]:
        """Yield the address of the page."""
        yield Text(text=self.page.as_uri())
        if not self.is_shown:
            yield Text(text="No browser could be opened; open this address in a browser.")


@dataclass(frozen=True)
class ExplainedCode:
    """Cause and remedy of an error code."""

    code: ErrorCode

    def document(self) -> dict[str, object]:
        """Return the code with its cause and remedy."""
        return {"code": self.code.name, "cause": self.code.cause, "remedy": self.code.remedy}

    def blocks(self) -> Iterator[Heading | Text]:
        """Yield the code, its cause and its remedy."""
        yield Heading(text=self.code.name, level=3)
        yield Text(text=f"Cause: {self.code.cause}")
        yield Text(text=f"Remedy: {self.code.remedy}")


def run(request: DocsRequest, context: Context) -> DocsResult | ExplainedCode:
    """Explain a code, or find a page and open it; with --json the page is not opened."""
    if request.topic is not None and request.topic.upper().startswith("RID-"):
        return ExplainedCode(find_code(request.topic))
    page = find_page(SITE, request.topic)
    is_shown = not request.open or context.as_json or webbrowser.open(page.as_uri())
    return DocsResult(page, is_shown)


def find_code(name: str) -> ErrorCode:
    """Return a declared error code; case is ignored.

    Raises:
        ConfigError: No message has this code.
    """
    codes = {code.name: code for code in declared_codes()}
    if name.upper() not in codes:
        similar = ", ".join(difflib.get_close_matches(name.upper(), codes, n=3)) or "none"
        raise ConfigError(
            f"no message has the code {name!r}; similar codes: {similar}", code="RID-DOCS-PAGE"
        )
    return codes[name.upper()]


def find_page(site: Path, topic: str | None) -> Path:
    """Return the page of a topic.

    Args:
        site: Folder of the documentation site.
        topic: Name of the page, or a part of its name; None for the start page.

    Raises:
        ConfigError: There is no site or no such page, or several pages match.
    """
    start = site / "index.html"
    if not start.is_file():
        raise ConfigError(
            "this installation contains no documentation: read the folder docs of the"
            " repository, or build the site with docs/site/build.py",
            code="RID-DOCS-MISSING",
        )
    if topic is None:
        return start
    pages = {
        path.relative_to(site).with_suffix("").as_posix(): path
        for path in sorted(site.rglob("*.html"))
        if path.stem not in {"genindex", "search"}
    }
    words = topic.lower().replace(" ", "-")
    exact = [name for name in pages if words in (name, name.rsplit("/", 1)[-1])]
    found = exact or [name for name in pages if words in name]
    if len(found) == 1:
        return pages[found[0]]
    if not found:
        raise ConfigError(
            f"no page has a name with {topic!r}; `rid-daq docs` opens the start page",
            code="RID-DOCS-PAGE",
        )
    raise ConfigError(
        f"{topic!r} matches {', '.join(found)}; give one of these names", code="RID-DOCS-PAGE"
    )


OPERATION: Final = Operation(
    name="docs",
    label="Documentation",
    request=DocsRequest,
    run=run,
    examples=("docs payload", "docs RID-FILE-READ"),
)
