"""Another process of this program, by this program's Python and its own packages."""

from __future__ import annotations

import sys


def own_python(module: str, *arguments: str) -> list[str]:
    """Return the command line that runs a module of this program.

    What lies in the folder where it starts, a `config.py` or a folder `drivers`, is not taken for
    ours (`python -P`).

    Parameters
    ----------
    module : str
        The module that is run, `rid_daq.worker`.
    *arguments : str
        Its arguments.
    """
    return [sys.executable, "-P", "-m", module, *arguments]
