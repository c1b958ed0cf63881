"""`group_runs`: runs that belong together, such as those of a payload session or an experiment."""

from __future__ import annotations

from collections.abc import Sequence

from rid_daq.service.api.run_index import RunEntry
from rid_daq.service.records import Record


class RunGroup(Record):
    """Runs that belong together.

    Attributes:
        head: The run or session to which the others belong. If this session is not in the list: its
            newest run with a model, or else its newest run.
        parts: The other runs, oldest first.
    """

    head: RunEntry
    parts: tuple[RunEntry, ...] = ()


def group_runs(entries: Sequence[RunEntry]) -> list[RunGroup]:
    """Return the groups of some runs; the group with the newest run is first.

    Runs of the same session belong together. A run whose result uses the model of another run
    belongs to that run, for example as its validation. A run of which another result was computed
    belongs to the first such run.

    Args:
        entries: The runs, newest first.
    """
    parents = _parents(entries)
    members: dict[str, list[RunEntry]] = {}
    for entry in entries:
        members.setdefault(_root(entry.session or entry.id, parents), []).append(entry)
    return [_group(root, found) for root, found in members.items()]


def _parents(entries: Sequence[RunEntry]) -> dict[str, str]:
    """Return the session or run to which each session or run belongs, if there is one."""
    nodes = {entry.id: entry.session or entry.id for entry in entries}
    owners = {entry.model: nodes[entry.id] for entry in entries if entry.model}
    parents: dict[str, str] = {}

    def put(node: str, parent: str | None) -> None:
        if parent is not None and node not in parents and _root(parent, parents) != node:
            parents[node] = parent

    for entry in reversed(entries):
        put(nodes[entry.id], owners.get(entry.used_model))
        for used in entry.used_runs:
            if used in nodes:
                put(nodes[used], nodes[entry.id])
    return parents


def _root(node: str, parents: dict[str, str]) -> str:
    while node in parents:
        node = parents[node]
    return node


def _group(root: str, members: Sequence[RunEntry]) -> RunGroup:
    """Return runs, which are sorted newest first, as one group."""
    own = [each for each in members if (each.session or each.id) == root] or members
    heads = [each for each in own if each.id == root] or [each for each in own if each.model] or own
    return RunGroup(
        head=heads[0], parts=tuple(each for each in reversed(members) if each != heads[0])
    )
