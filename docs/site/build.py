"""Make the documentation site from `docs/`: `python docs/site/build.py [FOLDER]`.

Without a folder it goes where `rid-daq docs` shows it and a wheel takes it from. Whatever Sphinx
warns of, a link that leads nowhere or a page that no other leads to, is an error.
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
    """Make the site in a folder, replacing its content; return Sphinx's exit code."""
    shutil.rmtree(folder, ignore_errors=True)
    with tempfile.TemporaryDirectory() as work:
        options = ["-q", "-W", "--keep-going", "-b", "html", "-c", str(DOCS / "site"), "-d", work]
        code = build_main([*options, str(DOCS), str(folder)])
    (folder / ".buildinfo").unlink(missing_ok=True)
    return code


if __name__ == "__main__":
    sys.exit(build(Path(sys.argv[1]) if len(sys.argv) > 1 else PACKAGED))
