"""`docs`: open the documentation that is installed with the program."""

from __future__ import annotations

import webbrowser
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

from pydantic import Field

from config.errors import ConfigError
from rid_daq.blocks.block import Text
from rid_daq.operations.operation import Context, Operation
from rid_daq.operations.option import Option
from rid_daq.operations.request import Request

SITE: Final = Path(__file__).resolve().parents[2] / "site"


class DocsRequest(Request):
    """Open the documentation in the browser: guides, reference, theory. It needs no internet."""

    topic: Annotated[
        str | None,
        Field(
            description="Page to open, such as `payload`, `faults` or the number of a decision"
            " (default: the start page)."
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
        is_shown: False if a browser was to show it and none could be opened.
    """

    page: Path
    is_shown: bool
    exit_code: int = 0

    def document(self) -> dict[str, object]:
        """Return the path of the page."""
        return {"page": str(self.page)}

    def blocks(self) -> Iterator[Text]:
        """Yield the address of the page."""
        yield Text(text=self.page.as_uri())
        if not self.is_shown:
            yield Text(text="No browser could be opened; open this address in one.")


def run(request: DocsRequest, context: Context) -> DocsResult:
    """Find a page and open it; for programs it is only found."""
    page = find_page(SITE, request.topic)
    is_shown = not request.open or context.as_json or webbrowser.open(page.as_uri())
    return DocsResult(page, is_shown)


def find_page(site: Path, topic: str | None) -> Path:
    """Return the page of a topic.

    Args:
        site: The folder of the site.
        topic: How the page's name begins, or a word of it; None for the start page.

    Raises:
        ConfigError: There is no site, no such page, or more than one.
    """
    start = site / "index.html"
    if not start.is_file():
        raise ConfigError(
            "this installation has no documentation: read the folder docs of the repository, or"
            " make the site with docs/site/build.py",
            code="RID-DOCS-PAGE",
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
            f"no page is called {topic!r}; `rid-daq docs` opens the start page",
            code="RID-DOCS-PAGE",
        )
    raise ConfigError(
        f"{topic!r} may be {', '.join(found)}; name one of them", code="RID-DOCS-PAGE"
    )


OPERATION: Final = Operation(
    name="docs",
    label="Documentation",
    request=DocsRequest,
    run=run,
    examples=("docs payload", "docs faults --no-open"),
    is_job=False,
    numerics=False,
)
