"""The `rid-daq` script, and `python -m rid_daq`."""

import signal
import sys
from importlib.util import find_spec
from pathlib import Path

# Until the program is imported and listens, Ctrl-C ends it as it ends any other: without a word.
if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, signal.SIG_DFL)

_ROOT = Path(__file__).resolve().parents[1]
_BELOW = (
    "acquisition",
    "compensation",
    "config",
    "drivers",
    "dynamics",
    "identification",
    "mock_hw",
)

# `python -m` looks for packages in the folder where it starts first: a person's files, not ours.
if __name__ == "__main__" and not sys.flags.safe_path and Path(sys.path[0]).resolve() != _ROOT:
    del sys.path[0]


def require_own_packages() -> None:
    """End the program where another package stands in for one of its own.

    Raises:
        SystemExit: A package that rid-daq imports would come from somewhere else.
    """
    for name in _BELOW:
        spec = find_spec(name)
        places = [] if spec is None else [*(spec.submodule_search_locations or [str(spec.origin)])]
        if _ROOT / name not in [Path(p).resolve() for p in places]:
            print(  # noqa: T201  nothing of the program can be imported
                f"rid-daq: its package `{name}` is not what Python finds: {places or 'nothing'}."
                " Install rid-daq into an environment of its own: `uv tool install rid-daq` or"
                " `pipx install rid-daq`.",
                file=sys.stderr,
            )
            sys.exit(2)


require_own_packages()

from rid_daq.app import main  # noqa: E402

if __name__ == "__main__":
    main()
