"""What hung on a simulated robot's flange in a run: noted in its folder, compared with afterwards.

Nothing of it reaches the estimate. On a real robot there is no such truth.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydantic import JsonValue

from acquisition.runs.folder import RunFolder
from config.arrays import FloatArray
from config.load import LoadedCell, load_bundled_or_path, to_yaml
from config.simulation.plant import PlantConfig
from identification.payload.body import PayloadBody, flange_pose, reported, to_link
from identification.payload.estimate import PayloadEstimate
from identification.payload.verdict import PayloadResult
from rid_daq.runs.run_data import PLANT, RunData

NOTHING = "nothing"
FACT = "simulated_flange"


def note_flange(folder: RunFolder, loaded: LoadedCell, payload: str | None) -> dict[str, JsonValue]:
    """Write a simulated run's plant file with what hangs on its flange (`attached`).

    Returns:
        What the run's manifest says of it.

    Raises:
        ConfigError: The plant has no such payload.
        RecordingError: The file cannot be written.
    """
    if loaded.plant is None:
        return {}
    plant = loaded.plant.with_payload(payload)
    comment = f"The simulated robot as it was in this run: {payload or NOTHING} on its flange."
    folder.write(PLANT, to_yaml(plant, comment).encode())
    return {FACT: payload or NOTHING}


def true_payload(
    folders: Sequence[RunFolder], estimate: PayloadEstimate
) -> tuple[str, FloatArray] | None:
    """Return name and `REPORTED` (10,) of what hung on the flange in all of some simulated runs.

    None where that was not noted: a real robot, a cell that another program served, or runs with
    different payloads.
    """
    if not all(FACT in folder.manifest().facts for folder in folders):
        return None
    names = {str(folder.manifest().facts[FACT]) for folder in folders}
    if len(names) != 1 or NOTHING in names:
        return None
    (name,) = names
    plant = load_bundled_or_path(str(folders[0].file(PLANT)), "plants", PlantConfig)
    body = plant.payloads[name]
    of_link = PayloadBody.of_reported(
        np.array([body.mass_kg, *body.centre_m, *body.inertia_kg_m2])
    ).parameters
    of_flange = np.linalg.solve(to_link(flange_pose(estimate.robot)), of_link)
    return name, reported(np.asarray(of_flange, dtype=np.float64))


def truth_sentence(name: str, truth: FloatArray, estimate: PayloadEstimate) -> str:
    """Say how far an estimate is from what really hung there."""
    off = estimate.reported - truth
    seen = np.array(estimate.seen)
    inside = int(np.count_nonzero(np.abs(off[seen]) <= 2.0 * estimate.sigma[seen]))
    centre = ", ".join(f"{1e3 * value:+.2f}" for value in off[1:4])
    return (
        f"Simulated: {name} was on the flange. The estimate is off by {1e3 * off[0]:+.0f} g and"
        f" ({centre}) mm; {inside} of {np.count_nonzero(seen)} values are within their intervals."
    )


def compared(data: Sequence[RunData], loaded: Sequence[bool], payload: PayloadResult) -> list[str]:
    """Return the comparison of a payload with the truth, where its runs know one, as findings."""
    folders = [run.folder for run, carried in zip(data, loaded, strict=True) if carried]
    found = true_payload(folders, payload.estimate)
    return [] if found is None else [truth_sentence(*found, payload.estimate)]
