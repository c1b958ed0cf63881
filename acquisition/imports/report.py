"""`ImportReport`: findings of an import, rows that were left out, and the reasons."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import asdict, dataclass
from typing import Final

from pydantic import TypeAdapter, ValidationError

from acquisition.clock.report import ClockReport
from acquisition.imports.plate_report import PlateReport
from acquisition.maps.torque_meaning import TorqueMeaning
from config.errors import RecordingError
from config.wrong_value import explain_error

RANGES_IN_WORDS = 20
_ASSUMED_TORQUES: Final = (
    "`torques`, the meaning of the torques, is not stated: measured motor currents, or torques of"
    " the motors, are assumed"
)


@dataclass(frozen=True)
class DamagedRow:
    """One row that is not used; `row` is its line number in the file, from 1."""

    row: int
    reason: str
    detail: str


@dataclass(frozen=True)
class DamagedRows:
    """Neighbouring rows that are not used.

    `counts` contains each reason and its number of rows, `examples` the first row of each reason.
    """

    first: int
    last: int
    counts: tuple[tuple[str, int], ...]
    examples: tuple[DamagedRow, ...]

    @property
    def count(self) -> int:
        """Number of rows left out."""
        return self.last - self.first + 1

    def __str__(self) -> str:
        where = f"row {self.first}" if self.first == self.last else f"rows {self.first}-{self.last}"
        words = ", ".join(
            f"{count} {reason} (row {example.row}: {example.detail})"
            for (reason, count), example in zip(self.counts, self.examples, strict=True)
        )
        return f"{where}: {words}"


@dataclass(frozen=True)
class ImportReport:
    """Report of an import.

    Attributes:
        file, map_name: Name of the file, without folders, and of the map.
        rows_read, rows_used: Number of rows with data, and of rows that are used.
        damaged: Rows left out, in order.
        duration_s: Time from the first to the last sound row, by their stamps [s].
        step_min_s, step_median_s, step_max_s: Steps of the time stamps [s], including repeated
            rows.
        gaps: Number of steps longer than 5 median steps.
        travel: Range of each joint's position [rad or m].
        velocity_ratio: For each joint, velocity from the positions divided by the velocity column:
            1 if both agree, None if there is no such column, the joint is at rest, or the rows are
            too few.
        refined_step: For each joint, the quantisation step of its position [rad or m]; between the
            steps, the position follows the recorded velocity. None without a visible step or a
            velocity.
        rounded_step: For each joint, the quantisation step that remains in its position because no
            velocity was recorded [rad or m]; None if no step remains or is visible.
        findings: Oddities of the used rows, one sentence each.
        static: True if no joint moves.
        torques: Meaning of the torques; None if the map does not state it.
        clock: Repeated rows, jitter and origin of the times; None if the clock was not judged.
        time_origin_ns: Origin of the times, if the stamps were whole nanoseconds [ns].
        plate: Report on the force plate; None without a plate.
    """

    file: str
    map_name: str
    rows_read: int
    rows_used: int
    damaged: tuple[DamagedRows, ...]
    duration_s: float
    step_min_s: float
    step_median_s: float
    step_max_s: float
    gaps: int
    travel: tuple[float, ...]
    velocity_ratio: tuple[float | None, ...]
    refined_step: tuple[float | None, ...] = ()
    rounded_step: tuple[float | None, ...] = ()
    findings: tuple[str, ...] = ()
    static: bool = False
    torques: TorqueMeaning | None = None
    clock: ClockReport | None = None
    time_origin_ns: int = 0
    plate: PlateReport | None = None

    @property
    def left_out(self) -> dict[str, int]:
        """Number of rows left out for each reason, the most frequent first."""
        counts: Counter[str] = Counter()
        for rows in self.damaged:
            counts.update(dict(rows.counts))
        return dict(counts.most_common())

    @property
    def rows_damaged(self) -> int:
        """Number of rows left out as damaged."""
        return sum(rows.count for rows in self.damaged)

    @property
    def headline(self) -> str:
        """Result of the import in one line."""
        repeated = 0 if self.clock is None else self.clock.repeated_rows
        words = "Imported without loss"
        if self.rows_damaged:
            words = f"Imported; {self.rows_damaged} damaged rows left out"
        elif repeated:
            words = "Imported"
        if repeated:
            words += f"; {repeated} repeated rows left out"
        if self.findings:
            words += f"; {len(self.findings)} findings"
        return words

    @property
    def notes(self) -> tuple[str, ...]:
        """Rows that are left out, and an assumed meaning of the torques; one sentence each."""
        noted = []
        if self.damaged:
            reasons = ", ".join(f"{count} {reason}" for reason, count in self.left_out.items())
            noted.append(
                f"{self.rows_damaged} of {self.rows_read} rows are left out as damaged: {reasons}"
            )
        if self.torques is None:
            noted.append(_ASSUMED_TORQUES)
        return tuple(noted)

    def to_json(self) -> bytes:
        """Return the report as JSON for `from_json`."""
        return json.dumps(asdict(self), indent=1).encode()

    @classmethod
    def from_json(cls, written: bytes, name: str) -> ImportReport:
        """Return the report from the contents of a file called `name`.

        Raises:
            RecordingError: The contents are not a report of this version.
        """
        try:
            return TypeAdapter(cls).validate_json(written)
        except ValidationError as error:
            first = error.errors()[0]
            place = ".".join(map(str, first["loc"])) or "the whole document"
            raise RecordingError(
                f"{name}: {place}: {explain_error(first)}: the file is not an import report of this"
                " version; import the file again",
                code="RID-RECORDING-FOREIGN",
            ) from error

    def lines(self) -> tuple[str, ...]:
        """Return the report as text, one finding per line."""
        repeated = 0 if self.clock is None else self.clock.repeated_rows
        mean_hz = (self.rows_used + repeated - 1) / self.duration_s
        found = [
            f"{self.file}: {self.rows_used} of {self.rows_read} rows used, {self.duration_s:.3f} s",
            f"time steps {_milliseconds(self.step_min_s)} to {_milliseconds(self.step_max_s)} ms,"
            f" median {_milliseconds(self.step_median_s)} ms, on average {mean_hz:.4g} Hz;"
            f" {self.gaps} gaps",
        ]
        if self.clock is not None:
            found.append(self.clock.line())
        steps = [step for step in self.refined_step if step is not None]
        if steps:
            found.append(
                f"positions are recorded in steps of at most {max(steps):.2g} rad or m; between"
                " steps they follow the recorded velocity"
            )
        if self.damaged:
            reasons = ", ".join(f"{count} {reason}" for reason, count in self.left_out.items())
            rows = "damaged row" if self.rows_damaged == 1 else "damaged rows"
            found.append(f"{self.rows_damaged} {rows} left out: {reasons}")
            found.extend(f"  {some}" for some in self.damaged[:RANGES_IN_WORDS])
            if len(self.damaged) > RANGES_IN_WORDS:
                found.append(f"  ... and {len(self.damaged) - RANGES_IN_WORDS} more ranges")
        elif self.clock is None or self.clock.is_sound:
            found.append("no damaged rows")
        if self.torques is None:
            found.append(_ASSUMED_TORQUES)
        if self.plate is not None:
            found.extend(self.plate.lines())
        found.extend(f"finding: {sentence}" for sentence in self.findings)
        return tuple(found)


def _milliseconds(seconds: float) -> str:
    """Return a time step in milliseconds, without exponents for long steps."""
    return f"{1e3 * seconds:.0f}" if seconds >= 1.0 else f"{1e3 * seconds:.3g}"


def group_damaged(rows: list[DamagedRow]) -> tuple[DamagedRows, ...]:
    """Return damaged rows as ranges of neighbours, in order."""
    groups: list[list[DamagedRow]] = []
    for row in sorted(rows, key=lambda damaged: damaged.row):
        if groups and row.row == groups[-1][-1].row + 1:
            groups[-1].append(row)
        else:
            groups.append([row])
    return tuple(_as_range(group) for group in groups)


def _as_range(rows: list[DamagedRow]) -> DamagedRows:
    counts = Counter(row.reason for row in rows)
    return DamagedRows(
        first=rows[0].row,
        last=rows[-1].row,
        counts=tuple(counts.items()),
        examples=tuple(next(row for row in rows if row.reason == reason) for reason in counts),
    )
