"""A payload session continues from its state after its worker or the service has ended."""

from __future__ import annotations

import contextlib
import json
import os
import signal
from pathlib import Path
from typing import Any

import pytest

from acquisition.motion.kinds.fourier import FourierJoint, FourierMotion
from config.errors import LockedError
from config.load import to_yaml
from rid_daq.service.client import ServiceClient
from rid_daq.service.records import CellState, Job
from rid_daq.terminal.job_events import SessionState as State
from tests.rid_daq.service.conftest import ServedProcess, serving
from tests.rid_daq.service.moving import CHECK, events, until

pytestmark = pytest.mark.slow

SHORT = {"rehearsal_percent": 80.0, "warm_up_percent": 50.0, "warm_up_periods": 4}
MOTION = FourierMotion(
    kind="fourier",
    robot="ir361",
    period_s=2.4,
    periods=3,
    ramp_s=2.0,
    joints=tuple(
        FourierJoint(joint=joint, sine=(0.1, 0.05), cosine=(0.0, 0.05))
        for joint in ("axis1", "axis2", "axis3")
    ),
)
"""Short motion of the bundled cell; its length and accuracy do not matter in these tests."""


class Operator:
    """A user who has leased the cell, answers a job's questions and reads its states.

    Args:
        client: The service.
        key: Key of a lease that has survived a restart of the service.
    """

    def __init__(self, client: ServiceClient, key: str = "") -> None:
        self.client = client
        self.answered: set[tuple[str, int]] = set()
        self.key = key or client.ask("POST", "/cells/ir361/lease", {"seconds": 1800.0})["key"]

    def begin(self, **request: object) -> Job:
        state = self.client.cell("ir361").state
        if state is CellState.FAULT:
            self.client.run("ir361", "reset", lease=self.key, cleared=True).require_done()
        if state is not CellState.READY:
            self.client.run("ir361", "check", CHECK, lease=self.key).require_done()
        session_request = {"practise": True, **request}
        body = {"kind": "payload_session", "request": session_request, "cleared": True}
        return Job.model_validate(self.client.ask("POST", "/cells/ir361/jobs", body, self.key))

    def answer_until(self, job: Job, end: State) -> list[str]:
        """Answer questions until the session enters a state; return all states that it entered."""
        entered: list[str] = []

        def is_there() -> bool:
            job_events: list[dict[str, Any]] = events(self.client, job)
            entered[:] = [each["state"] for each in job_events if each["kind"] == "state"]
            for each in job_events:
                if each["kind"] == "asked" and (job.id, each["question"]) not in self.answered:
                    if entered and entered[-1] == end.value:
                        break
                    text = "ir361" if each["form"] == "text" else "yes"
                    told_back = {"question": each["question"], "text": text}
                    with contextlib.suppress(
                        LockedError
                    ):  # the service has not read the question yet
                        self.client.ask("POST", f"/jobs/{job.id}/answer", told_back, self.key)
                        self.answered.add((job.id, each["question"]))
            state = self.client.job(job.id).state
            assert end.value in entered or not state.is_over, job_events[-1]
            return end.value in entered

        until(is_there, period_s=0.3)  # the service answers with all events each time
        return entered

    def end(self, job: Job, how: str) -> None:
        """End a job: cancel it, or kill its worker."""
        pid = self.client.job(job.id).pid
        assert pid is not None
        if how == "killed":
            os.kill(pid, signal.SIGKILL)
        else:
            self.client.ask("POST", f"/jobs/{job.id}/cancel", {}, self.key)
        until(lambda: self.client.job(job.id).state.is_over)


def stored_state(folder: Path) -> tuple[str, State]:
    """Return the id of the single session in a folder, and the state in its file."""
    (file,) = (folder / "runs").glob("*/session.json")
    return file.parent.name, State(json.loads(file.read_text())["state"])


def test_a_session_continues_from_every_state(served: ServedProcess) -> None:
    (served.folder / "motion.yaml").write_text(to_yaml(MOTION), encoding="utf-8")
    with served.client as client:
        operator = Operator(client)
        job = operator.begin(motion="motion.yaml", **SHORT)
        for state, how, again in (
            (State.REHEARSE, "cancelled", State.REHEARSE),
            (State.WARM_UP_WITHOUT, "killed", State.WARM_UP_WITHOUT),
            (State.RECORD_WITHOUT, "cancelled", State.WARM_UP_WITHOUT),
        ):
            operator.answer_until(job, state)
            operator.end(job, how)
            session, at = stored_state(served.folder)
            assert at is state
            job = operator.begin(resume=session)
            assert operator.answer_until(job, again)[0] == again.value
        operator.answer_until(job, State.ATTACH)
    assert served.end(signal.SIGKILL) == -signal.SIGKILL  # while the user attaches the payload
    assert stored_state(served.folder) == (session, State.ATTACH)
    with serving(served.folder) as again_served, again_served.client as client:
        until(lambda: client.cell("ir361").job is None)
        operator = Operator(client, operator.key)
        job = operator.begin(resume=session)
        for state in (State.WARM_UP_WITH, State.RECORD_WITH):
            assert operator.answer_until(job, state)[0] == State.ATTACH.value
            operator.end(job, "cancelled")
            assert stored_state(served.folder) == (session, state)
            job = operator.begin(resume=session)
        assert operator.answer_until(job, State.IDENTIFY)[:3] == [
            *(State.ATTACH.value, State.WARM_UP_WITH.value, State.RECORD_WITH.value)
        ]
        until(lambda: client.job(job.id).state.is_over, period_s=0.3)
        job = operator.begin(
            resume=session
        )  # no payload was attached: the payload is estimated again
        assert operator.answer_until(job, State.IDENTIFY) == [State.IDENTIFY.value]
