"""`history_of`: estimates of one robot, run by run, from the results in the run folders."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any, Final

import numpy as np

from acquisition.runs.catalogue import list_runs
from acquisition.runs.folder import RunFolder
from config.errors import ConfigError, RecordingError
from config.formats.json_file import parse_json
from rid_daq.blocks.block import AnyBlock, Cells, Interval, Verdict, table
from rid_daq.blocks.formats import format_utc
from rid_daq.blocks.plot import Axis, Line, Panel, Plot
from rid_daq.service.api.runs import RESULT

DAY_S: Final = 86400.0


@dataclass(frozen=True)
class HistoryEntry:
    """Estimate of one run.

    Attributes:
        run_id, label, created_utc: The run.
        value, std: The estimate and its standard deviation.
    """

    run_id: str
    label: str
    created_utc: str
    value: float
    std: float

    @property
    def interval(self) -> Interval | float:
        """The estimate with its 95 % interval if its standard deviation is known."""
        return Interval(value=self.value, reach=2.0 * self.std) if self.std else self.value


@dataclass(frozen=True)
class QuantityHistory:
    """One quantity of a robot over its runs, oldest first.

    Attributes:
        title, unit: Name and unit of the quantity.
        entries: At least one entry.
    """

    title: str
    unit: str
    entries: Sequence[HistoryEntry]

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield a summary of the change, the plot and the table."""
        yield Verdict(passed=None, text=self.sentence)
        yield self.plot
        yield table(
            self.entries,
            Cells("run", lambda each: each.run_id, is_run=True),
            Cells("label", lambda each: each.label),
            Cells("when", lambda each: format_utc(each.created_utc)),
            Cells("estimate ± 2σ", lambda each: each.interval, self.unit),
        )

    @property
    def plot(self) -> Plot:
        """Plot of the estimates with their intervals over time."""
        starts = [datetime.fromisoformat(each.created_utc) for each in self.entries]
        line = Line(
            "estimate ± 2σ",
            tuple((each - starts[0]).total_seconds() / DAY_S for each in starts),
            tuple(each.value for each in self.entries),
            "ink",
            reach=tuple(2.0 * each.std for each in self.entries),
            points=True,
        )
        panel = Panel(
            x=Axis("since the first run", "d"),
            y=Axis(self.title, self.unit),
            lines=(line,),
            height_px=280,
        )
        return Plot(name="history", panels=(panel,))

    @property
    def sentence(self) -> str:
        """Sentence with the change from the first to the newest estimate and its significance."""
        first, last = self.entries[0], self.entries[-1]
        if len(self.entries) == 1:
            return "Only one run: there is no other run to compare with."
        change = last.value - first.value
        both = float(np.hypot(first.std, last.std))
        words = f"{change:+.3g} {self.unit} from the first run to the newest"
        if both == 0.0:
            return f"{words}; the uncertainty is unknown."
        sigmas = abs(change) / both
        verdict = "more than noise explains" if sigmas > 3.0 else "noise can explain the change"
        return f"{words}: {sigmas:.1f} standard deviations, {verdict}."


def history_of(runs: Path, robot: str) -> tuple[QuantityHistory, ...]:
    """Return the history of every quantity in the results of a robot.

    Runs with an unreadable result are left out; their own page shows the reason.

    Args:
        runs: Folder of the run folders.
        robot: Name of the robot.
    """
    found: dict[tuple[str, str], list[HistoryEntry]] = {}
    for folder, manifest in list_runs(runs):
        if manifest.facts.get("robot") != robot:
            continue
        try:
            quantities = tuple(_quantities(_result(folder)))
        except (
            AttributeError,
            KeyError,
            TypeError,
            ValueError,
        ):  # the file is not a result of rid-daq
            continue
        for title, unit, value, std in quantities:
            entry = HistoryEntry(manifest.run_id, manifest.label, manifest.created_utc, value, std)
            found.setdefault((title, unit), []).append(entry)
    return tuple(
        QuantityHistory(title, unit, tuple(entries)) for (title, unit), entries in found.items()
    )


def _result(folder: RunFolder) -> dict[str, Any]:
    try:
        found = parse_json(folder.read(RESULT))
    except (ConfigError, RecordingError):
        return {}
    return found if isinstance(found, dict) else {}


def _quantities(result: dict[str, Any]) -> Iterator[tuple[str, str, float, float]]:
    """Yield title, unit, value and standard deviation of each quantity in a result."""
    for section, prefix in (("estimate", ""), ("payload", "payload ")):
        for each in (result.get(section) or {}).get("parameters", ()):
            if each.get("value") is not None:
                name = each.get("words") or each["name"]
                yield (
                    f"{prefix}{name}",
                    str(each["unit"]),
                    float(each["value"]),
                    float(each.get("std") or 0.0),
                )
