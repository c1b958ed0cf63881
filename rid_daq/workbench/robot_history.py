"""`history_of`: what was identified of one robot, run by run, from the results in the runs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.runs.catalogue import list_runs
from acquisition.runs.folder import RunFolder
from config.errors import ConfigError, RecordingError
from config.formats.json_file import parse_json
from rid_daq.service.api.runs import RESULT


@dataclass(frozen=True)
class HistoryEntry:
    """An estimate of one run.

    Attributes:
        run_id, label, created_utc: Of which run.
        value, std: The estimate and its standard deviation.
    """

    run_id: str
    label: str
    created_utc: str
    value: float
    std: float


@dataclass(frozen=True)
class QuantityHistory:
    """One quantity of a robot over its runs, oldest first.

    Attributes:
        title, unit: What it is.
        entries: At least one.
    """

    title: str
    unit: str
    entries: Sequence[HistoryEntry]

    @property
    def sentence(self) -> str:
        """Whether the newest estimate differs from the first by more than both intervals allow."""
        first, last = self.entries[0], self.entries[-1]
        if len(self.entries) == 1:
            return "One run only: nothing to compare it with yet."
        change = last.value - first.value
        both = float(np.hypot(first.std, last.std))
        words = f"{change:+.3g} {self.unit} from the first run to the newest"
        if both == 0.0:
            return f"{words}; their uncertainty is not known."
        sigmas = abs(change) / both
        verdict = "more than noise explains" if sigmas > 3.0 else "noise explains it"
        return f"{words}: {sigmas:.1f} standard deviations, {verdict}."


def history_of(runs: Path, robot: str) -> tuple[QuantityHistory, ...]:
    """Return the history of every quantity that results tell of a robot.

    Runs whose result cannot be read are left out: their own page tells why.

    Args:
        runs: The folder of the run folders.
        robot: The robot's name.
    """
    found: dict[tuple[str, str], list[HistoryEntry]] = {}
    for folder, manifest in list_runs(runs):
        if manifest.facts.get("robot") != robot:
            continue
        try:
            quantities = tuple(_quantities(_result(folder)))
        except (AttributeError, KeyError, TypeError, ValueError):  # no result of ours
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
    """Yield title, unit, value and standard deviation of what a result estimates."""
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
