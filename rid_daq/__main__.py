"""The `rid-daq` script, and `python -m rid_daq`."""

import signal

# Until the program is imported and listens, Ctrl-C ends it as it ends any other: without a word.
if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, signal.SIG_DFL)

from rid_daq.app import main

if __name__ == "__main__":
    main()
