"""`rid-daq docs`: the documentation that is installed with the program, in the browser."""

from __future__ import annotations

import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from config.errors import ConfigError
from rid_daq.terminal.console import Console
from rid_daq.terminal.options import AsJson

SITE = Path(__file__).resolve().parents[1] / "site"


def docs(
    topic: Annotated[
        str | None,
        typer.Argument(
            metavar="[TOPIC]",
            help="A page to open: `payload`, `faults`, a decision's number ...; the start page if"
            " not given.",
            show_default=False,
        ),
    ] = None,
    opened: Annotated[
        bool, typer.Option("--open/--no-open", help="Open the browser, or only say where it is.")
    ] = True,
    as_json: AsJson = False,
) -> None:
    """Open the documentation in the browser: guides, reference, theory. It needs no internet."""
    page = find_page(SITE, topic)
    console = Console(as_json)
    console.document({"page": str(page)})
    console.say(page.as_uri())
    if opened and not as_json and not webbrowser.open(page.as_uri()):
        console.say("No browser could be opened; open this address in one.")


def find_page(site: Path, topic: str | None) -> Path:
    """Return the page of a topic.

    Parameters
    ----------
    site : Path
        The folder of the site.
    topic : str or None
        How the page's name begins, or a word of it; None for the start page.

    Raises
    ------
    ConfigError
        There is no site, no such page, or more than one.
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
