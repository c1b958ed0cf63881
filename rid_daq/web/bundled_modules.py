"""Third-party JavaScript and CSS of the pages, which the build bundles.

`javascript/bundle.py` makes the bundle and its manifest.
"""

from __future__ import annotations

import functools
import hashlib
import json
from collections.abc import Mapping
from importlib.resources import files
from typing import Final

from config.errors import ConfigError

BUNDLE: Final = files("rid_daq").joinpath("workbench", "bundled")
_REMEDY: Final = (
    "in a clone, run `uv sync --reinstall-package rid-daq`; otherwise install the wheel of the"
    " release again"
)


@functools.cache
def bundled_modules() -> Mapping[str, bytes]:
    """Return the JavaScript modules and CSS files by name.

    Raises:
        ConfigError: The bundle is missing or damaged.
    """
    try:
        listed = json.loads(BUNDLE.joinpath("manifest.json").read_bytes())["files"]
        modules = {name: BUNDLE.joinpath(name).read_bytes() for name in listed}
    except OSError as error:
        raise ConfigError(
            f"the bundle of JavaScript is not installed ({error}): {_REMEDY}",
            code="RID-INSTALL-BUNDLE",
        ) from error
    for name, content in modules.items():
        if hashlib.sha256(content).hexdigest() != listed[name]:
            raise ConfigError(
                f"{BUNDLE.joinpath(name)} is not the file that the build made: {_REMEDY}",
                code="RID-INSTALL-BUNDLE",
            )
    return {name: content for name, content in modules.items() if name.endswith((".js", ".css"))}
