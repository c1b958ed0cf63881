"""`perform`: run an operation and show its result."""

from __future__ import annotations

from config.process.linux import require_linux
from rid_daq.operations.operation import FailedResult, JudgedResult, Operation
from rid_daq.requests.request import Request
from rid_daq.terminal.console import Console


def perform(operation: Operation, request: Request, console: Console) -> None:
    """Run an operation and show its result.

    Args:
        console: Console that shows the result; a worker's console writes events instead.

    Raises:
        ConfigError: The operation needs Linux, and this system is another (RID-SYSTEM-LINUX).
        RidDaqError: The error of the operation, or the failure of its result.
        SystemExit: Exit code of the result, if it is not 0.
    """
    if operation.needs_linux:
        require_linux(f"`rid-daq {operation.name}`")
    operation.load()
    result = operation.run(request, console)
    console.result(result.document(), result.blocks())
    if isinstance(result, FailedResult) and result.failure is not None:
        raise result.failure
    if isinstance(result, JudgedResult) and result.exit_code:
        raise SystemExit(result.exit_code)
