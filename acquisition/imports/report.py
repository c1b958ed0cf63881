"""`ImportReport`: what was found in someone else's file, what was left out of it, and why."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import asdict, dataclass

from pydantic import TypeAdapter, ValidationError

from acquisition.clock.report import ClockReport
from config.errors import RecordingError

RANGES_IN_WORDS = 20


@dataclass(frozen=True)
class DamagedRow:
    """One row that is not used; `row` counts from 1 as an editor does."""

    row: int
    reason: str
    detail: str


@dataclass(frozen=True)
class DamagedRows:
    """Neighbouring rows that are not used.

    `counts` says how many for which reason; `examples` is the first row of each reason.
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
    """What an import read.

    Attributes:
        file, map_name: Name of the file, without folders, and of the map.
        rows_read, rows_used: Rows of data looked at, and those that went into the recording.
        damaged: Rows left out, in order.
        duration_s: From the first used row to the last [s].
        step_min_s, step_median_s, step_max_s: Time steps between used rows [s].
        gaps: Steps longer than 5 median steps.
        travel: Range of each joint's position [rad or m].
        velocity_ratio: Per joint, velocity from the positions over the velocity column; 1 where
            both agree, None where there is no such column or the joint stands still.
        refined_step: Per joint, the step that its position was recorded in [rad or m] and between
            which it follows the recorded velocity; None where there is no such step or no velocity.
        findings: What is odd about the rows used, a sentence each.
        static: Whether no joint moves.
        clock: Repeated rows, jitter, and where the times come from; None if it was not judged.
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
    findings: tuple[str, ...] = ()
    static: bool = False
    clock: ClockReport | None = None

    @property
    def left_out(self) -> dict[str, int]:
        """How many rows were left out for which reason, the most frequent first."""
        counts: Counter[str] = Counter()
        for rows in self.damaged:
            counts.update(dict(rows.counts))
        return dict(counts.most_common())

    @property
    def rows_damaged(self) -> int:
        """Number of rows left out as damaged."""
        return sum(rows.count for rows in self.damaged)

    def to_json(self) -> bytes:
        """Return the report as `from_json` reads it."""
        return json.dumps(asdict(self), indent=1).encode()

    @classmethod
    def from_json(cls, written: bytes, name: str) -> ImportReport:
        """Return the report in the bytes of a file called `name`.

        Raises:
            RecordingError: They are no report of this version.
        """
        try:
            return TypeAdapter(cls).validate_json(written)
        except ValidationError as error:
            raise RecordingError(f"{name}: {error}", code="RID-RECORDING-FOREIGN") from error

    def lines(self) -> tuple[str, ...]:
        """Return the report in words, a finding a line."""
        repeated = 0 if self.clock is None else self.clock.repeated_rows
        mean_hz = (self.rows_used + repeated - 1) / self.duration_s
        found = [
            f"{self.file}: {self.rows_used} of {self.rows_read} rows used, {self.duration_s:.3f} s",
            f"time steps {_ms(self.step_min_s)} to {_ms(self.step_max_s)} ms, median"
            f" {_ms(self.step_median_s)} ms, on average {mean_hz:.4g} Hz; {self.gaps} gaps",
        ]
        if self.clock is not None:
            found.append(self.clock.line())
        steps = [step for step in self.refined_step if step is not None]
        if steps:
            found.append(
                f"positions are recorded in steps of {max(steps):.2g} rad or m at most; between two"
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
        found.extend(f"finding: {sentence}" for sentence in self.findings)
        return tuple(found)


def _ms(seconds: float) -> str:
    """Return a time step in milliseconds, never with an exponent above them."""
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
