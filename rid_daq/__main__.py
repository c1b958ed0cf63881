"""The `rid-daq` script, and `python -m rid_daq`."""

import signal
import sys
from pathlib import Path

# Until the program is imported and listens, Ctrl-C ends it as it ends any other: without a word.
if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, signal.SIG_DFL)

_ROOT = Path(__file__).resolve().parents[1]
# `python -m` looks for packages in the folder where it starts first: a person's files, not ours.
if __name__ == "__main__" and not sys.flags.safe_path and Path(sys.path[0]).resolve() != _ROOT:
    del sys.path[0]


from rid_daq.own_packages import hidden_package  # noqa: E402

if hidden := hidden_package():
    print(hidden, file=sys.stderr)  # noqa: T201  nothing of the program can be imported
    sys.exit(2)

from rid_daq.app import main  # noqa: E402

if __name__ == "__main__":
    main()
