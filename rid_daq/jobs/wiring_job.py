"""From runs to the mistakes that explain them far better than their files."""

from __future__ import annotations

from collections.abc import Sequence

from config.robot.robot import RobotDescription
from identification.wiring.search import find_mistakes
from identification.wiring.signals import WiredSignals
from rid_daq.jobs.identification_job import EstimationRequest, signals_of
from rid_daq.jobs.wiring_words import mistake_entry
from rid_daq.report.sections.mistake import MistakeEntry
from rid_daq.runs.run_data import RunData


def diagnose_wiring(
    data: Sequence[RunData], how: EstimationRequest, robot: RobotDescription
) -> tuple[MistakeEntry, ...]:
    """Try the common mistakes of wiring, units and files on runs of one robot.

    Runs that carried an unknown payload are left out.

    Parameters
    ----------
    data : sequence of RunData
        The runs, all periodic or all not.
    how : EstimationRequest
        The highest frequency, and which runs were loaded.
    robot : RobotDescription
        The robot as its file says it is.

    Returns
    -------
    tuple of MistakeEntry
        Empty where none explains the data far better.
    """
    empty = [item for item in data if item.folder.run_id not in how.loaded]
    signals = WiredSignals.of(robot, signals_of(empty, how))
    imported = data[0].import_report is not None
    return tuple(mistake_entry(each, robot, imported=imported) for each in find_mistakes(signals))
