"""`estimate_blocks`: the parameters of a robot with their intervals, and the quality of the fit."""

from __future__ import annotations

from collections.abc import Iterator

from identification.regression.fit_grade import Grade
from rid_daq.blocks.block import (
    AnyBlock,
    Cell,
    Cells,
    Heading,
    Interval,
    Table,
    Text,
    Verdict,
    table,
)
from rid_daq.blocks.formats import format_measured, number, unit
from rid_daq.report.mistake_entry import MistakeEntry
from rid_daq.report.section_blocks.verdict import doubt_texts, yes_or_no
from rid_daq.report.sections.estimate import EstimateSection, ParameterEntry


def estimate_blocks(section: EstimateSection) -> Iterator[AnyBlock]:
    """Yield the method, mistakes, fits, parameters and findings."""
    yield Heading(text="Parameters with their intervals")
    yield Text(text=section.sentence)
    yield from mistake_blocks(section)
    if any(axis.reason for axis in section.axes):
        yield from fit_blocks(section)
    yield parameter_table(section)
    yield from finding_texts(section)


def fit_verdict(section: EstimateSection) -> Verdict:
    """Return a verdict: passed if the model explains the torque of every axis."""
    bad = [axis.joint for axis in section.axes if axis.grade is Grade.BAD]
    if not bad:
        return Verdict(passed=True, text="The model explains the torque of every axis.")
    return Verdict(
        passed=False,
        text=f"The model does not explain the torque of {', '.join(bad)}, so it is exported only"
        " with --despite-misfit. Correct the files, then identify again.",
    )


def mistake_blocks(section: EstimateSection) -> Iterator[AnyBlock]:
    """Yield each probable mistake, and the lines to change."""
    for mistake in section.mistakes or ():
        yield Verdict(passed=False, text=mistake.sentence)
        yield Text(text=_remedy(mistake))
        for place in mistake.places or ():
            yield Text(text=place.words)
        if mistake.alternatives:
            as_good = "; ".join(other.words for other in mistake.alternatives)
            yield Text(text=f"Equally good explanation: {as_good}.")


def _remedy(mistake: MistakeEntry) -> str:
    return f"Change {' or '.join(mistake.change)}, then identify the run again."


def fit_blocks(section: EstimateSection) -> Iterator[AnyBlock]:
    """Yield the fit of each axis, and the reasons for poor grades."""
    yield table(
        section.axes,
        Cells("axis", lambda axis: axis.joint),
        Cells("unit", lambda axis: axis.unit),
        Cells("RMS torque", lambda axis: axis.torque),
        Cells("residual (RMS)", lambda axis: axis.residual),
        Cells("residual / torque", lambda axis: axis.percent, "%", 3),
        Cells("residual / noise", lambda axis: axis.over_noise, digits=2),
        Cells("fit", lambda axis: axis.grade or "–"),
        failed=lambda axis: axis.grade is Grade.BAD,
    )
    yield from doubt_texts(section.axes)


def parameter_table(section: EstimateSection) -> Table:
    """Return the parameters with intervals; for a simulated robot also the true values."""
    numbered = list(enumerate(section.parameters, start=1))
    columns: list[Cells[tuple[int, ParameterEntry]]] = [
        Cells("#", lambda each: each[0]),
        Cells("parameter", lambda each: each[1].words),
        Cells("estimate ± 2σ", lambda each: _value(each[1])),
        Cells("unit", lambda each: unit(each[1].unit)),
        Cells("σ from noise", lambda each: each[1].std_noise, digits=2),
        Cells("σ from residuals", lambda each: each[1].std_residual, digits=2),
    ]
    if section.has_truth:
        columns.extend(
            [
                Cells("truth", lambda each: format_measured(each[1].truth, _reach(each[1]))[0]),
                Cells("inside 2σ", lambda each: yes_or_no(each[1].inside_two_sigma)),
            ]
        )
    return table(numbered, *columns, failed=lambda each: each[1].inside_two_sigma is False, key=2)


def _reach(each: ParameterEntry) -> float | None:
    return None if each.at_bound or each.not_shown else 2.0 * each.std


def _value(each: ParameterEntry) -> Cell:
    if (reach := _reach(each)) is not None:
        return Interval(value=each.value, reach=reach)
    return f"{number(each.value)}, {'at its bound' if each.at_bound else 'not identified'}"


def finding_texts(section: EstimateSection) -> Iterator[Text]:
    """Yield the remarks on the estimate."""
    if section.unseen:
        yield Text(
            text=f"Parameters without any effect on the torques: {', '.join(section.unseen)}."
        )
    for finding in section.findings or ():
        yield Text(text=finding)
    if section.mistakes == ():
        yield Text(text="No sign of a common mistake in wiring, units or files was found.")
        yield from _unconfirmed_texts(section)


def _unconfirmed_texts(section: EstimateSection) -> Iterator[Text]:
    weight = section.arm_weight
    if weight is not None and weight.differs:
        yield Text(
            text=f"The torques give the arm {number(weight.share, 2)} times the weight of `cad` in"
            " the robot file: check the torques' unit and constants, the lengths and `cad`."
        )
    for moved in filter(lambda each: each.differs, section.moved_masses or ()):
        rotor = ", although this mass includes the rotor" if moved.has_rotor else ""
        yield Text(
            text=f"The force of {moved.joint} accelerates {number(moved.drawn, 2)} times the mass"
            f" in `cad` of the robot file{rotor}: check the unit and the constant of the force, the"
            " gear ratio and `cad`."
            + ("" if moved.has_rotor else " If the motor has a rotor, write `armature: true`.")
        )
    if section.unconfirmed is None:
        yield Text(text="The recordings are too short to confirm the entries of the files.")
    elif section.unconfirmed:
        entries = "; ".join(each.words for each in section.unconfirmed)
        yield Text(
            text="The recordings do not confirm these entries of the files, because wrong entries"
            f" fit about as well: {entries}. Check them on the robot."
        )
