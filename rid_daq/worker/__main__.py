"""`python -m rid_daq.worker`: the template of the workers, which execute the service's jobs."""

import sys

if __name__ == "__main__":
    from rid_daq.worker.worker import main

    sys.exit(main())
