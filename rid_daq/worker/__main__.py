"""`python -m rid_daq.worker`: one job of the service, told on standard input."""

import sys

if __name__ == "__main__":
    from rid_daq.worker.worker import main

    sys.exit(main())
