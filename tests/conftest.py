"""One thread of BLAS a test worker: they share the cores, as in `rid_daq.app`."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
