"""Findings about an estimate: remarks, as sentences, that the result shows below the parameters."""

from __future__ import annotations

from config.errors import EstimationError
from identification.accuracy.identifiability import (
    few_cluster_findings,
    noiseless_findings,
    still_findings,
    unseen_findings,
    weak_parameters,
)
from identification.consistency.closest_robot import check_consistency
from identification.consistency.consistency_test import ConsistencyTest
from identification.estimation.estimate import Estimate
from identification.validation.friction_drift import friction_drift
from identification.wiring.torque_origin import torque_contradiction
from rid_daq.operations.estimation.missing_effects import MissingEffects
from rid_daq.operations.estimation.wiring_findings import WiringDiagnosis
from rid_daq.report.sections.plate import PlateSection
from rid_daq.runs.run_data import RunData


def estimate_findings(
    estimate: Estimate, data: tuple[RunData, ...], weight: tuple[str, ...]
) -> list[str]:
    """Return the findings about an estimate, as sentences.

    Args:
        data: Runs of the estimate.
        weight: Result of `weight_words`; these parameters do not count as weak.
    """
    weak = [each for each in weak_parameters(estimate) if each.expression not in weight]
    findings = [
        *still_findings(estimate),
        *few_cluster_findings(estimate),
        *noiseless_findings(estimate),
        *unseen_findings(estimate),
        *(each.sentence for each in weak),
    ]
    for item in filter(lambda each: each.is_periodic, data):
        drifts = (drift for drift in friction_drift(item.parts()) if drift.significant)
        findings += [f"Run {item.folder.run_id}: {drift.sentence}." for drift in drifts]
    return findings


def contradictions_of(
    wiring: WiringDiagnosis, missing: MissingEffects, plate: PlateSection | None
) -> tuple[str, ...]:
    """Return the reasons to reject an estimate besides bad fits, one sentence each."""
    found = [*(each.sentence for each in wiring.mistakes or ()), *wiring.sentences]
    if wrong := (*missing.late, *missing.clipped):
        found.append(f"The recorded torque of {', '.join(wrong)} is late or clipped.")
    found += missing.payloads
    if plate is not None and plate.mistake is not None:
        found.append(plate.mistake.sentence)
    return tuple(found)


def contradictions_of_torque_meaning(
    data: tuple[RunData, ...], wiring: WiringDiagnosis
) -> list[str]:
    """Return a finding for each run whose torques contradict the meaning in its import map."""
    if wiring.mistakes is None:
        return []
    kinds, findings = [each.kind for each in wiring.mistakes], []
    for item in data:
        if item.import_report is not None:
            stated = item.import_report.torques
            if why := torque_contradiction(stated, item.recording, item.robot, kinds):
                findings.append(f"Run {item.folder.run_id}: {why}")
    return findings


def examine_consistency(estimate: Estimate) -> tuple[ConsistencyTest | None, str]:
    """Return the test of physical consistency, or None if it cannot be made, and a sentence."""
    try:
        test = check_consistency(estimate)
    except EstimationError as error:
        return None, f"The physical consistency of the parameters cannot be tested: {error}."
    if test.is_consistent:
        return test, (
            f"{test.sentence} This test says nothing about the fit: see the residual of each axis."
        )
    return test, (
        f"{test.sentence} The model lacks a term, or a sign, gear ratio or torque constant in the"
        " robot file is wrong."
    )
