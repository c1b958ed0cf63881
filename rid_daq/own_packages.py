"""`hidden_package`: find a file or package that hides a package of rid-daq."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import Final

_CODE: Final = "RID-INSTALL-HIDDEN"
_ROOT: Final = Path(__file__).resolve().parents[1]
_BELOW: Final = (
    "acquisition",
    "compensation",
    "config",
    "drivers",
    "dynamics",
    "identification",
    "mock_hw",
)


def hidden_package() -> str:
    """Return an error text if another file hides a package of rid-daq; empty otherwise.

    Nothing is imported.
    """
    for name in _BELOW:
        try:
            spec = find_spec(name)
        except ValueError:  # a module that was put into sys.modules by hand
            spec = None
        places = [] if spec is None else [*(spec.submodule_search_locations or [str(spec.origin)])]
        if _ROOT / name not in [Path(place).resolve() for place in places]:
            return (
                f"rid-daq: its package `{name}` is hidden by {', '.join(places) or 'nothing'}."
                " Rename that file or folder, start Python in another folder, or install rid-daq"
                " into its own environment: `uv tool install rid-daq` or `pipx install"
                f" rid-daq`. [{_CODE}]"
            )
    return ""
