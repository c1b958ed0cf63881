"""`find_missing_effects`: effects that an estimate lacks, although its runs show them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

from acquisition.processing.smoothing import SmoothedSignals
from config.column_file import each_column, has_few_values
from config.errors import EstimationError
from identification.accuracy.torque_drift import find_torque_drifts
from identification.elasticity.elastic_fit import rigid_averages
from identification.equations.bus_delay import longest_delay_s
from identification.equations.compared_joints import candidate_equations
from identification.equations.segments import period_signals, thin_rows
from identification.equations.stretches import smoothed_stretches
from identification.estimation.estimate import Estimate
from identification.estimation.fitted_signals import fit_smoothed
from identification.validation.further_terms import further_term_findings
from identification.validation.model_choice import ModelChoice
from identification.validation.torque_filters import channel_findings
from identification.wiring.clipped_torques import ClippedTorque, find_clipped_torques
from identification.wiring.late_torques import LateTorque, find_late_torques
from rid_daq.operations.estimation.run_estimation import EstimationJob, period_averages
from rid_daq.operations.estimation.unstated_payload import find_unstated_payload
from rid_daq.operations.estimation.wiring_findings import WiringDiagnosis
from rid_daq.runs.run_data import RunData

FEW_VALUES: Final = 50
"""A torque with fewer different values is rounded coarsely."""


@dataclass(frozen=True)
class MissingEffects:
    """Effects that an estimate lacks.

    Attributes:
        findings: One sentence each.
        late: Joints whose torques are later than any bus explains.
        clipped: Joints whose torques are clipped.
        payloads: Runs with a payload that is not stated, one sentence each.
    """

    findings: tuple[str, ...] = ()
    late: tuple[str, ...] = ()
    clipped: tuple[str, ...] = ()
    payloads: tuple[str, ...] = ()


def find_missing_effects(
    estimate: Estimate,
    data: Sequence[RunData],
    how: EstimationJob,
    comparison: ModelChoice | None,
    wiring: WiringDiagnosis,
) -> MissingEffects:
    """Return findings on effects that an estimate lacks.

    Args:
        comparison: The model chosen by `--choose`; None without it.
        wiring: Mistakes that were found in files and wiring; with a mistake the joints contradict
            one another, and a delay of all torques is not reported again for each joint.
    """
    stretches = _coarse_signals(estimate, data, how)
    coarse = [run for own in stretches for run in own]
    if not coarse:
        return MissingEffects()
    options = how.options
    channel = None if comparison is None else comparison.channel
    slowest = options.standstill_rad_s
    equations = candidate_equations(estimate.robot, coarse, options.model, slowest)
    clipped: tuple[ClippedTorque, ...] = ()
    late: tuple[LateTorque, ...] = ()
    if equations is not None:
        limit_s = longest_delay_s(coarse[0].sample_period_s)
        if not wiring.mistakes:
            clipped = find_clipped_torques(estimate.robot, equations, _coarse_torques(data))
        compare = not (wiring.mistakes or wiring.late_s)
        late = find_late_torques(estimate.robot, equations, limit_s, channel, compare=compare)
    clipped_joints = tuple(each.joint for each in clipped)
    late = tuple(each for each in late if each.joint not in clipped_joints)
    findings, payloads = _drifts_and_payloads(estimate, data, how, stretches, wiring)
    if comparison is None:
        findings += further_term_findings(estimate.robot, coarse, options)
    findings += [each.sentence for each in late]
    named = (*(each.joint for each in late), *clipped_joints)
    findings += [each.sentence for each in clipped]
    is_clock_known = all(item.clock is None or item.clock.is_known for item in data)
    can_show_channel = is_clock_known and not data[0].is_periodic and not how.has_rounded_positions
    if comparison is None and can_show_channel and not wiring.are_all_late:
        findings += channel_findings(estimate.robot, coarse, options, named)
    return MissingEffects(
        tuple(findings),
        tuple(each.joint for each in late if each.is_long),
        clipped_joints,
        payloads,
    )


def _coarse_signals(
    estimate: Estimate, data: Sequence[RunData], how: EstimationJob
) -> list[list[SmoothedSignals]]:
    """Return runs as low-passed signals, to compare an estimate with richer models.

    There is one list for each run. The result is empty for runs with a payload or known bodies, for
    a model that uses a force plate, or with a joint at rest.
    """
    if how.loaded or how.bodies or how.options.model.kind != "internal" or estimate.still:
        return []
    if data[0].is_periodic:
        averages = rigid_averages(estimate, period_averages(data))
        return [[period_signals(average, how.options.band_hz)] for average in averages]
    return smoothed_stretches([item.recording for item in data], how.options.band_hz)


def _coarse_torques(data: Sequence[RunData]) -> set[str]:
    """Return the joints whose torques have so few values that they look clipped."""
    return {
        name
        for item in data
        for name, torque in zip(
            item.robot.joint_names, each_column(item.recording.torque_nm), strict=True
        )
        if has_few_values(torque, FEW_VALUES)
    }


def _drifts_and_payloads(
    estimate: Estimate,
    data: Sequence[RunData],
    how: EstimationJob,
    stretches: Sequence[Sequence[SmoothedSignals]],
    wiring: WiringDiagnosis,
) -> tuple[list[str], tuple[str, ...]]:
    """Return a finding for each torque that drifts, and one for a payload that is not stated.

    There are none if parts of the runs do not determine the parameters. Torques of a model with
    warming and of periodic runs are not examined for drift. Runs with mistakes, and a single run,
    are not examined for payloads.
    """
    can_drift = not data[0].is_periodic and estimate.warming is None
    can_be_loaded = len(data) > 1 and not wiring.mistakes
    if not (can_drift or can_be_loaded):
        return [], ()
    numbers = [number for number, own in enumerate(stretches) for _ in own]
    runs = [thin_rows(replace(run, channel=estimate.channel)) for own in stretches for run in own]
    options = replace(how.options, model=estimate.options)
    try:
        fitted = fit_smoothed(estimate.robot, runs, options)
    except EstimationError:  # stretches of a long recording do not determine the parameters
        return [], ()
    ids = [item.folder.run_id for item in data]
    drifts: list[str] = []
    payloads: tuple[str, ...] = ()
    if can_drift and fitted.base.names == estimate.base.names:
        found = find_torque_drifts(fitted, estimate.sigma, numbers)
        drifts = [f"Run {ids[each.recording]}: {each.sentence}." for each in found]
    if can_be_loaded:
        loaded = find_unstated_payload(estimate.robot, runs, numbers, options, fitted)
        payloads = () if loaded is None else (loaded.sentence(ids[loaded.run]),)
    return drifts, payloads
