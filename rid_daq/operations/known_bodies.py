"""`known_bodies`: known bodies that the robot carried in each run (`--loads`)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from acquisition.runs.catalogue import find_run
from config.errors import ConfigError
from identification.model.known_loads import Bodies, KnownBody, read_known_loads
from rid_daq.runs.run_data import RunData


def known_bodies(file: Path | None, runs: Path, data: tuple[RunData, ...]) -> Mapping[str, Bodies]:
    """Return the known bodies of each run that carried some, by the ids of the runs.

    Args:
        file: File with the bodies and the runs that carried them; None without known bodies.
        runs: Folder of the run folders, in which the file's names of runs are searched for.
        data: The runs to identify.

    Raises:
        ConfigError: The file is invalid, names a run twice, or names another run.
        RecordingError: The manifest of a named run cannot be read.
    """
    if file is None:
        return {}
    loads = read_known_loads(file, data[0].robot)
    used = {item.folder.run_id for item in data}
    found: dict[str, dict[str, KnownBody]] = {}
    for each in loads.loads:
        run_id = find_run(runs, each.run).run_id
        if run_id not in used:
            raise ConfigError(
                f"{file}: run {each.run!r} is not among the runs to identify: add it to RUN...",
                code="RID-PAYLOAD-RUNS",
            )
        if run_id in found:
            raise ConfigError(
                f"{file}: `loads` names run {each.run!r} twice: list its bodies in one entry",
                code="RID-FILE-DUPLICATE",
            )
        found[run_id] = {name: loads.bodies[name] for name in each.bodies}
    return found
