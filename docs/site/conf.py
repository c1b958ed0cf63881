"""Sphinx configuration of the documentation site; `docs/site/build.py` runs it."""

import json
import re
import tomllib
from pathlib import Path

import mermaidx
from docutils import nodes
from sphinx.application import Sphinx

_ROOT = Path(__file__).resolve().parents[2]
_PROJECT = tomllib.loads((_ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]

project = "rid-daq"
author = copyright = "The rid-daq founders"
release = version = _PROJECT["version"]
extensions = ["myst_parser"]
source_suffix = {".md": "markdown"}
exclude_patterns = ["site", "**/_build"]
myst_heading_anchors = 4
myst_enable_extensions = ["dollarmath"]
html_theme = "furo"
html_static_path = ["static"]
html_css_files = ["wide.css"]
html_search_scorer = str(Path(__file__).with_name("scorer.js"))
html_title = f"rid-daq {version}"
html_show_sourcelink = False
html_copy_source = False
html_show_sphinx = False
html_theme_options = {
    "navigation_with_keys": True,
    "footer_icons": [],
}

_WIDE_PX, _READABLE_PX = 1400, 960
_MERMAID = {
    "theme": "neutral",
    # These are the widest usual fonts, so a text fits its box with any other font too.
    "fontFamily": "Verdana, DejaVu Sans, sans-serif",
    "flowchart": {"wrappingWidth": 400},
}


def _draw(app: Sphinx, doctree: nodes.document) -> None:
    """Replace the source text of a mermaid diagram by the drawn diagram."""
    blocks = [
        each for each in doctree.findall(nodes.literal_block) if each.get("language") == "mermaid"
    ]
    for number, block in enumerate(blocks, start=1):
        text = f"%%{{init: {json.dumps(_MERMAID)}}}%%\n{block.astext()}"
        drawing = mermaidx.render(text).svg().replace("my-svg", f"drawing-{number}")
        found = re.search(r"max-width: ([\d.]+)px", drawing)
        least = _READABLE_PX if found is not None and float(found[1]) > _WIDE_PX else 0
        frame = "overflow-x: auto; background: #fff; border-radius: .3rem; padding: .5rem"
        drawing = drawing.replace('style="', f'style="min-width: {least}px; ', 1)
        html = f'<div class="drawing" style="{frame}" tabindex="0">{drawing}</div>'
        block.replace_self(nodes.raw("", html, format="html"))


def setup(app: Sphinx) -> None:
    """Let Sphinx draw the diagrams of each page after it has read the page."""
    app.connect("doctree-read", _draw)
