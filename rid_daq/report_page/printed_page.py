"""`print_pdf`: prints a page to PDF with an installed Chromium."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Final

from config.errors import ConfigError, RecordingError
from config.formats.whole_file import write_whole

BROWSERS: Final = (
    *("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome"),
)
PATIENCE_S: Final = 120.0


def print_pdf(page: Path, output: Path) -> None:
    """Print a page to PDF.

    Args:
        page: The HTML file.
        output: The PDF file.

    Raises:
        ConfigError: No Chromium is installed (RID-PDF-BROWSER).
        RecordingError: Chromium failed (RID-PDF-FAILED), or the PDF cannot be written.
    """
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        raise ConfigError(
            f"{output}: cannot print PDF, because no Chromium is installed: install one, or open"
            f" {page} in a browser and print it",
            code="RID-PDF-BROWSER",
        )
    with tempfile.TemporaryDirectory(prefix="rid-daq-") as folder:
        printed = Path(folder) / "page.pdf"
        words = [
            browser,
            "--headless",
            "--disable-gpu",
            "--no-pdf-header-footer",
            f"--user-data-dir={folder}/profile",
            f"--print-to-pdf={printed}",
            page.resolve().as_uri(),
        ]
        if os.geteuid() == 0:
            words.insert(1, "--no-sandbox")  # Chromium refuses to run as root with a sandbox
        try:
            finished = subprocess.run(
                words, capture_output=True, timeout=PATIENCE_S, check=False, text=True
            )
            reason = finished.stderr.strip().splitlines()[-1:]
        except (OSError, subprocess.TimeoutExpired) as error:
            reason = [str(error)]
        if not printed.is_file():
            raise RecordingError(
                f"{output}: {browser} could not print {page}:"
                f" {' '.join(reason) or 'it gave no reason'}; open the page in a browser and"
                " print it",
                code="RID-PDF-FAILED",
            )
        write_whole(output, printed.read_bytes())
