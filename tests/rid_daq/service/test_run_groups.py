"""Runs that belong together are listed as one group: a payload session, or an experiment."""

from __future__ import annotations

from pathlib import Path

from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RunStatus
from rid_daq.service.api.run_groups import RunGroup, group_runs
from rid_daq.service.api.run_index import RunIndex
from rid_daq.terminal.choices import MODEL

MODEL_BYTES = b"{}"


def recorded(root: Path, label: str, **facts: object) -> RunFolder:
    """Write a complete run with facts."""
    folder = RunFolder.create(root, label)
    folder.finish(RunStatus.COMPLETE, facts)  # type: ignore[arg-type]
    return folder


def groups(root: Path) -> list[RunGroup]:
    return group_runs(RunIndex(root).newest_first())


def labels(root: Path) -> list[list[str]]:
    """Return the labels of the runs in each group; the first label is that of the head."""
    return [[each.head.label, *(part.label for part in each.parts)] for each in groups(root)]


def test_a_payload_session_is_the_head_of_its_runs(tmp_path: Path) -> None:
    session = RunFolder.create(tmp_path, "gripper", kind="payload session")
    for step in ("rehearsal", "unloaded", "loaded"):
        recorded(tmp_path, step, session=session.run_id)
    recorded(tmp_path, "another day")
    assert labels(tmp_path) == [["another day"], ["gripper", "rehearsal", "unloaded", "loaded"]]


def test_a_rehearsal_belongs_to_the_motion_that_was_recorded_after_it(tmp_path: Path) -> None:
    recorded(tmp_path, "excitation rehearsal", session="1")
    recorded(tmp_path, "excitation", session="1")
    assert labels(tmp_path) == [["excitation", "excitation rehearsal"]]


def test_runs_of_a_result_and_validations_belong_to_the_run_with_the_model(tmp_path: Path) -> None:
    """A validation belongs to a model by the model's SHA-256, independently of the file names."""
    second = recorded(tmp_path, "second excitation", session="2")
    first = recorded(tmp_path, "first excitation", session="1")
    first.write(MODEL, MODEL_BYTES, {"used_runs": [first.run_id, second.run_id]})
    (entry,) = (each for each in RunIndex(tmp_path).newest_first() if each.model)
    recorded(tmp_path, "validation rehearsal", session="3")
    recorded(tmp_path, "validation", session="3", used_model=entry.model)
    recorded(tmp_path, "validation of another model", used_model="0" * 64)
    assert labels(tmp_path) == [
        ["validation of another model"],
        ["first excitation", "second excitation", "validation rehearsal", "validation"],
    ]


def test_runs_that_use_each_other_are_one_group(tmp_path: Path) -> None:
    one = recorded(tmp_path, "one")
    two = recorded(tmp_path, "two", used_runs=[one.run_id])
    one.finish(RunStatus.COMPLETE, {"used_runs": [two.run_id]})
    assert len(labels(tmp_path)) == 1


def test_a_run_used_by_several_results_belongs_to_the_first(tmp_path: Path) -> None:
    empty = recorded(tmp_path, "empty flange")
    recorded(tmp_path, "gripper", used_runs=[empty.run_id])
    recorded(tmp_path, "camera", used_runs=[empty.run_id])
    assert labels(tmp_path) == [["camera"], ["gripper", "empty flange"]]


def test_the_summary_has_verdict_reason_and_cell(tmp_path: Path) -> None:
    facts = {"cell": "ir361", "verdict": "failed", "headline": "Stopped", "why": "axis2 too fast"}
    recorded(tmp_path, "stopped", **facts)
    (group,) = groups(tmp_path)
    head = group.head
    assert (head.cell, head.verdict, head.headline, head.reason) == tuple(facts.values())
