"""Make the documentation site from `docs/`: `python docs/site/build.py [FOLDER]`.

Without FOLDER, the site is written into `rid_daq/site`. `rid-daq docs` shows this folder, and the
wheel contains it. Every warning of Sphinx is an error, for example a broken link, or a page to
which no other page links.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from pathlib import Path

from sphinx.cmd.build import build_main

DOCS = Path(__file__).resolve().parents[1]
PACKAGED = DOCS.parent / "rid_daq" / "site"


def build(folder: Path) -> int:
    """Build the site in a folder, whose content is replaced; return Sphinx's exit code."""
    shutil.rmtree(folder, ignore_errors=True)
    with tempfile.TemporaryDirectory() as work:
        options = ["-q", "-W", "--keep-going", "-b", "html", "-c", str(DOCS / "site"), "-d", work]
        code = build_main([*options, str(DOCS), str(folder)])
    (folder / ".buildinfo").unlink(missing_ok=True)
    return code


if __name__ == "__main__":
    sys.exit(build(Path(sys.argv[1]) if len(sys.argv) > 1 else PACKAGED))
