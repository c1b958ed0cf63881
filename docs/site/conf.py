"""How Sphinx makes the documentation site; `docs/site/build.py` runs it."""

import tomllib
from pathlib import Path

from pygments.lexers.special import TextLexer
from sphinx.highlighting import lexers

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
lexers["mermaid"] = TextLexer()  # pictures in the repository's own viewer, here their text
html_theme = "furo"
html_title = f"rid-daq {version}"
html_show_sourcelink = False
html_copy_source = False
html_show_sphinx = False
html_theme_options = {
    "navigation_with_keys": True,
    "footer_icons": [],
}
