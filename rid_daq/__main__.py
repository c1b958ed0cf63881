"""The `rid-daq` script, and `python -m rid_daq`."""

import signal
import sys
from pathlib import Path

# Until the program handles signals itself, Ctrl-C ends it silently, like any other program.
if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, signal.SIG_DFL)

_ROOT = Path(__file__).resolve().parents[1]
# `python -m` searches the current folder first, which contains the user's files, not our packages.
if __name__ == "__main__" and not sys.flags.safe_path and Path(sys.path[0]).resolve() != _ROOT:
    del sys.path[0]


from rid_daq.own_packages import hidden_package  # noqa: E402

if hidden := hidden_package():
    print(hidden, file=sys.stderr)  # noqa: T201  the program's console cannot be imported here
    sys.exit(2)

from rid_daq.app import main  # noqa: E402

if __name__ == "__main__":
    main()
