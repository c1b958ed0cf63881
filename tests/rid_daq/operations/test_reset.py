"""Output of `reset` about the drives: a remaining fault is an error."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from config.errors import PreflightError
from drivers.servo.cia402 import PowerState
from drivers.servo.fault_reset import FaultReset
from rid_daq.blocks.block import Table, Verdict
from rid_daq.operations.cell.reset import OPERATION, ResetRequest, ResetResult
from rid_daq.operations.perform import perform
from rid_daq.terminal.console import Console
from tests.builders.raised_codes import raises_code


def drive(after: PowerState, refusal: str = "") -> FaultReset:
    return FaultReset("axis2", 2, PowerState.FAULT, after, "4310h", refusal)


@pytest.mark.parametrize(
    "stuck", [drive(PowerState.FAULT), drive(PowerState.SWITCH_ON_DISABLED, "0609 0030h")]
)
def test_a_remaining_fault_is_an_error_with_exit_code_3(
    stuck: FaultReset, capsys: pytest.CaptureFixture[str]
) -> None:
    result = ResetResult(ResetRequest(cell="ir361"), "ir361", (stuck,))
    blocks = list(result.blocks())
    assert result.exit_code == 3
    assert [each.failed for each in blocks if isinstance(each, Table)] == [(True,)]
    assert [each.passed for each in blocks if isinstance(each, Verdict)] == [False]
    with raises_code(PreflightError, "RID-DRIVE-FAULT", "axis2", "node 2", "4310h"):
        perform(replace(OPERATION, run=lambda *_: result), result.request, Console(as_json=True))
    (shown,) = json.loads(capsys.readouterr().out)["drives"]
    assert shown["after"] == stuck.after.words


def test_drives_without_a_fault_give_a_passed_result() -> None:
    result = ResetResult(
        ResetRequest(cell="ir361"), "ir361", (drive(PowerState.SWITCH_ON_DISABLED),)
    )
    assert (result.exit_code, result.failure) == (0, None)
    assert [each.passed for each in result.blocks() if isinstance(each, Verdict)] == [True]
