"""The service's log: one JSON document a line on standard error, with the job's id where one is."""

from __future__ import annotations

import json
import logging
import sys
from datetime import UTC, datetime
from typing import Final

from rid_daq.service.records import Job

LOG: Final = logging.getLogger("rid_daq.service")


class _Lines(logging.Formatter):
    def format(self, record: logging.LogRecord) -> str:
        line = {
            "time": datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds"),
            "level": record.levelname.lower(),
            "message": record.getMessage(),
        }
        job = getattr(record, "job", None)
        if isinstance(job, Job):
            line |= {"job": job.id, "cell": job.cell, "kind": job.kind.value, "owner": job.owner}
            line |= {"state": job.state.value}
        if record.exc_info:
            line["error"] = self.formatException(record.exc_info)
        return json.dumps(line)


def log_to_stderr() -> None:
    """Have the log written to standard error."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(_Lines())
    LOG.addHandler(handler)
    LOG.setLevel(logging.INFO)
    LOG.propagate = False
