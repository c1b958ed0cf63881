"""`RunPair`: conditions, verdicts, residuals and payloads of two runs, side by side."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final, NamedTuple

from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import Manifest
from config.errors import ConfigError
from config.load import load_robot
from rid_daq.blocks.block import AnyBlock, Cell, Cells, Heading, Interval, Table, table
from rid_daq.blocks.formats import format_utc, number
from rid_daq.report.result import Result
from rid_daq.report.result_file import RESULT, read_result
from rid_daq.report.sections.payload import PayloadParameter
from rid_daq.runs.run_data import CELL, FEEDFORWARD, MOTION, PLANT, ROBOT

_FILES: Final = (CELL, ROBOT, MOTION, FEEDFORWARD, PLANT)
_NONE: Final = "–"


class Row(NamedTuple):
    """A condition or value of both runs."""

    name: str
    first: Cell
    second: Cell

    @property
    def differs(self) -> str:
        """`differs` if the two values differ; otherwise empty."""
        return "" if self.first == self.second else "differs"


@dataclass(frozen=True)
class RunSide:
    """One of two runs that are compared.

    Attributes:
        folder: The run.
        manifest: Manifest of the run.
        result: Result of the run; None without one.
    """

    folder: RunFolder
    manifest: Manifest
    result: Result | None

    @classmethod
    def read(cls, folder: RunFolder) -> RunSide:
        """Read a run.

        Raises:
            ConfigError, RecordingError: The manifest or the result cannot be read.
        """
        has_result = folder.file(RESULT).exists()
        return cls(folder, folder.manifest(), read_result(folder) if has_result else None)

    @property
    def name(self) -> str:
        """Label of the run; its id if it has no label."""
        return self.manifest.label or self.folder.run_id

    def fact(self, name: str) -> str:
        """Return a fact of the run's manifest as text; return a dash if there is no such fact."""
        found = self.manifest.facts.get(name)
        return _NONE if found in (None, "") else str(found)

    def conditions(self) -> Iterator[tuple[str, str]]:
        """Yield name and value of each condition, for every run in the same order."""
        manifest, runs = self.manifest, () if self.result is None else self.result.runs or ()
        software = manifest.software
        yield "begun", format_utc(manifest.created_utc)
        yield "kind", manifest.kind
        yield "status", manifest.status
        yield "stop reason", self.fact("why")
        yield "cell", self.fact("cell")
        yield "operator", self.fact("operator")
        yield "simulated flange", self.fact("simulated_flange")
        yield "rows", str(sum(run.rows for run in runs)) if runs else self.fact("rows")
        yield "duration [s]", f"{sum(run.duration_s for run in runs):.1f}" if runs else _NONE
        yield "rid-daq", f"{software.get('rid-daq', _NONE)} {software.get('commit', '')}".strip()
        yield "verdict", _NONE if self.result is None else self.result.verdict.headline
        for name in _FILES:
            entry = manifest.files.get(name)
            yield name, _NONE if entry is None else f"SHA-256 {entry.sha256[:12]}…"

    def axis_values(self) -> Iterator[tuple[tuple[str, str, str], float | None]]:
        """Yield quantity, joint and unit, and the value of each axis in the result."""
        if self.result is None:
            return
        if self.result.estimate is not None:
            for fit in self.result.estimate.axes:
                yield ("RMS residual of the estimate", fit.joint, fit.unit), fit.residual
        if self.result.validation is not None:
            for error in self.result.validation.axes:
                key = ("relative torque error", error.joint, "%")
                yield key, error.relative_error_percent
        if self.result.payload is not None:
            for axis in self.result.payload.axes:
                yield ("residual of the payload", axis.joint, "%"), axis.residual_percent
        runs = self.result.runs or ()
        axes = runs[0].axes if len(runs) == 1 else ()
        for each in axes:
            yield ("largest torque", each.joint, each.torque_unit), each.max_torque
        for each in axes:
            yield ("largest following error", each.joint, each.unit), each.max_following_error


@dataclass(frozen=True)
class RunPair:
    """Two runs of the same robot."""

    first: RunSide
    second: RunSide

    @classmethod
    def of(cls, first: RunFolder, second: RunFolder) -> RunPair:
        """Read two runs, and require that they can be compared.

        Raises:
            ConfigError: The runs are of different robots (RID-ROBOT-OTHER), are the same run
                (RID-OPTION-EXCLUSIVE), or a robot file is damaged.
            RecordingError: A result cannot be read.
        """
        if first.run_id == second.run_id:
            raise ConfigError(
                f"run {first.run_id} is named twice: name two runs", code="RID-OPTION-EXCLUSIVE"
            )
        names = [_robot_of(folder) for folder in (first, second)]
        if names[0] != names[1]:
            one, other = (f"{robot} ({', '.join(joints)})" for robot, joints in names)
            raise ConfigError(
                f"run {first.run_id} is of robot {one}, but run {second.run_id} of {other}:"
                " compare runs of the same robot",
                code="RID-ROBOT-OTHER",
            )
        return cls(RunSide.read(first), RunSide.read(second))

    @cached_property
    def conditions(self) -> tuple[Row, ...]:
        """Conditions of the runs that at least one of them has."""
        both = zip(self.first.conditions(), self.second.conditions(), strict=True)
        rows = (Row(name, one, other) for (name, one), (_, other) in both)
        return tuple(row for row in rows if {row.first, row.second} != {_NONE})

    @cached_property
    def limits(self) -> tuple[Row, ...]:
        """Values that a verdict of the runs compares with limits."""
        found = []
        for side in (self.first, self.second):
            checks = () if side.result is None else side.result.verdict.checks
            words = {True: "passed", False: "FAILED"}
            found.append(
                {
                    each.text: f"{number(each.value, 4)} {each.unit} {each.relation}"
                    f" {number(each.limit, 4)}: {words[each.passed]}"
                    for each in checks
                }
            )
        one, other = found
        return tuple(
            Row(text, one.get(text, _NONE), other.get(text, _NONE)) for text in {**one, **other}
        )

    @cached_property
    def axes(self) -> tuple[tuple[tuple[str, str, str], float | None, float | None], ...]:
        """Quantity, joint and unit, and the values of both runs."""
        one, other = dict(self.first.axis_values()), dict(self.second.axis_values())
        return tuple((key, one.get(key), other.get(key)) for key in {**one, **other})

    @cached_property
    def payloads(self) -> tuple[tuple[PayloadParameter, PayloadParameter], ...]:
        """Payload parameters that both runs have estimated."""
        one, other = (
            ()
            if side.result is None or side.result.payload is None
            else side.result.payload.parameters
            for side in (self.first, self.second)
        )
        by_name = {each.name: each for each in other}
        pairs = ((each, by_name[each.name]) for each in one if each.name in by_name)
        return tuple(pair for pair in pairs if None not in (pair[0].value, pair[1].value))

    def document(self) -> dict[str, object]:
        """Return all tables as numbers and texts."""

        def rows(found: Sequence[Row]) -> list[dict[str, object]]:
            return [{**row._asdict(), "differs": bool(row.differs)} for row in found]

        return {
            "conditions": rows(self.conditions),
            "limits": rows(self.limits),
            "axes": [
                {"quantity": key[0], "joint": key[1], "unit": key[2], "first": a, "second": b}
                for key, a, b in self.axes
            ],
            "payload": [
                {
                    "name": one.name,
                    "unit": one.unit,
                    "first": one.value,
                    "first_std": one.std,
                    "second": other.value,
                    "second_std": other.std,
                    "sigmas": _sigmas(one, other),
                }
                for one, other in self.payloads
            ],
        }

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield the tables of conditions, limits, axes and payloads."""
        yield Heading(text="Conditions and verdicts")
        yield self._table("condition", self.conditions)
        if self.limits:
            yield Heading(text="Values and limits")
            yield self._table("quantity", self.limits)
        if self.axes:
            yield Heading(text="Each axis")
            yield self._axis_table()
        if self.payloads:
            yield Heading(text="Payload")
            yield self._payload_table()

    def _heads(self) -> tuple[str, str]:
        """Return the column titles of both runs: their labels, with the ids if these are equal."""
        one, other = self.first, self.second
        if one.name != other.name:
            return one.name, other.name
        return f"{one.name} {one.folder.run_id}", f"{other.name} {other.folder.run_id}"

    def _table(self, title: str, rows: Sequence[Row]) -> Table:
        first, second = self._heads()
        return table(
            rows,
            Cells(title, lambda row: row.name),
            Cells(first, lambda row: row.first),
            Cells(second, lambda row: row.second),
            Cells("", lambda row: row.differs),
        )

    def _axis_table(self) -> Table:
        first, second = self._heads()
        return table(
            self.axes,
            Cells("quantity", lambda row: row[0][0]),
            Cells("axis", lambda row: row[0][1]),
            Cells(first, lambda row: row[1], digits=3),
            Cells(second, lambda row: row[2], digits=3),
            Cells("unit", lambda row: row[0][2]),
        )

    def _payload_table(self) -> Table:
        first, second = self._heads()
        return table(
            self.payloads,
            Cells("parameter", lambda pair: pair[0].name),
            Cells(f"{first} ± 2σ", lambda pair: _interval(pair[0])),
            Cells(f"{second} ± 2σ", lambda pair: _interval(pair[1])),
            Cells("unit", lambda pair: pair[0].unit),
            Cells("difference [σ]", _shown_sigmas),
        )


def _robot_of(folder: RunFolder) -> tuple[str, tuple[str, ...]]:
    """Return the name and joints of a run's robot.

    Raises:
        ConfigError, RecordingError: The run has no robot file, or it cannot be read.
    """
    path = folder.file(ROBOT)
    if not path.exists():
        raise ConfigError(
            f"run {folder.run_id} has no {ROBOT}, so its robot is unknown: compare other runs",
            code="RID-RUN-DAMAGED",
        )
    robot = load_robot(str(path))
    return robot.name, robot.joint_names


def _interval(parameter: PayloadParameter) -> Cell:
    assert parameter.value is not None
    return Interval.of(parameter.value, parameter.std) if parameter.std else parameter.value


def _sigmas(one: PayloadParameter, other: PayloadParameter) -> float | None:
    """Return the difference in standard deviations; None if both are known exactly."""
    assert one.value is not None
    assert other.value is not None
    both = math.hypot(one.std or 0.0, other.std or 0.0)
    return (other.value - one.value) / both if both else None


def _shown_sigmas(pair: tuple[PayloadParameter, PayloadParameter]) -> str:
    sigmas = _sigmas(*pair)
    return _NONE if sigmas is None else f"{round(sigmas, 1) + 0.0:+.1f}"
