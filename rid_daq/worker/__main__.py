"""`python -m rid_daq.worker`: executes one job of the service, read from standard input."""

import sys

if __name__ == "__main__":
    from rid_daq.worker.worker import main

    sys.exit(main())
