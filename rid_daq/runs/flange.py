"""Payload on a simulated robot's flange: stored in the run folder, later compared with estimates.

An estimate never uses it. A real robot has no such true value.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydantic import JsonValue

from acquisition.runs.folder import RunFolder
from config.arrays import FloatArray
from config.load import LoadedCell, load_bundled_or_path, to_yaml
from config.simulation.plant import PlantConfig
from dynamics.geometry.kinematics import flange_pose
from identification.payload.body import PayloadBody, parameters_to_parent, reported
from identification.payload.estimate import PayloadEstimate
from identification.payload.verdict import PayloadResult
from rid_daq.runs.run_data import PLANT, RunData

NOTHING = "nothing"
FACT = "simulated_flange"


def write_flange_state(
    folder: RunFolder, loaded: LoadedCell, payload: str | None
) -> dict[str, JsonValue]:
    """Write a simulated run's plant file; its key `attached` names the payload on the flange.

    Returns:
        Facts for the run's manifest; empty for a real cell, which has no plant file.

    Raises:
        ConfigError: The plant has no such payload.
        RecordingError: The file cannot be written.
    """
    if loaded.plant is None:
        return {}
    plant = loaded.plant.with_payload(payload)
    comment = f"The simulated robot in this run, with {payload or NOTHING} on its flange."
    folder.write(PLANT, to_yaml(plant, comment).encode())
    return {FACT: payload or NOTHING}


def true_payload(
    folders: Sequence[RunFolder], estimate: PayloadEstimate
) -> tuple[str, FloatArray] | None:
    """Return name and true values (`REPORTED`, (10,)) of the payload in some simulated runs.

    None if the payload is unknown: the robot is real, another program simulated the cell, the
    flange was empty, or the runs have different payloads.
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
    of_flange = np.linalg.solve(parameters_to_parent(flange_pose(estimate.robot)), of_link)
    return name, reported(np.asarray(of_flange, dtype=np.float64))


def truth_sentence(name: str, truth: FloatArray, estimate: PayloadEstimate) -> str:
    """Return a sentence on the error of an estimate of a simulated payload."""
    off = estimate.reported - truth
    known = np.array(estimate.is_determined)
    inside = int(np.count_nonzero(np.abs(off[known]) <= 2.0 * estimate.sigma[known]))
    centre = ", ".join(f"{1e3 * value:+.2f}" for value in off[1:4])
    return (
        f"Simulated: {name} was on the flange. The estimate is off by {1e3 * off[0]:+.0f} g and"
        f" ({centre}) mm; {inside} of {np.count_nonzero(known)} values are within their intervals."
    )


def compare_with_truth(
    data: Sequence[RunData], loaded: Sequence[bool], payload: PayloadResult
) -> list[str]:
    """Return a sentence that compares an estimate with the true payload, if that is known."""
    folders = [run.folder for run, carried in zip(data, loaded, strict=True) if carried]
    found = true_payload(folders, payload.estimate)
    return [] if found is None else [truth_sentence(*found, payload.estimate)]
