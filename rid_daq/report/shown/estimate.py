"""`estimate_blocks`: the parameters of a robot with their intervals, and how well they fit."""

from __future__ import annotations

from collections.abc import Iterator

from identification.regression.fit_grade import Grade
from rid_daq.blocks.block import AnyBlock, Cell, Column, Heading, Interval, Table, Text, Verdict
from rid_daq.blocks.formats import measured, number, unit
from rid_daq.report.mistake_entry import MistakeEntry
from rid_daq.report.sections.estimate import EstimateSection, ParameterEntry
from rid_daq.report.shown.verdict import doubt_texts


def estimate_blocks(section: EstimateSection) -> Iterator[AnyBlock]:
    """Yield the method, mistakes, fits, parameters and findings.

    Args:
        section: The estimate.
    """
    yield Heading(text="Parameters with their intervals")
    yield Text(text=section.sentence)
    yield from mistake_blocks(section)
    if any(axis.reason for axis in section.axes):
        yield from fit_blocks(section)
    yield parameter_table(section)
    yield from finding_texts(section)


def fit_verdict(section: EstimateSection) -> Verdict:
    """Return whether the model explains the torque of every axis.

    Args:
        section: The estimate.
    """
    bad = [axis.joint for axis in section.axes if axis.grade is Grade.BAD]
    if not bad:
        return Verdict(passed=True, text="The model explains the torque of every axis.")
    return Verdict(
        passed=False,
        text=f"The model does not explain the torque of {', '.join(bad)}: it is not exported"
        " without --despite-misfit. Correct the files, then identify again.",
    )


def mistake_blocks(section: EstimateSection) -> Iterator[AnyBlock]:
    """Yield each mistake that explains the data far better, and the lines to change.

    Args:
        section: The estimate.
    """
    for mistake in section.mistakes or ():
        yield Verdict(passed=False, text=mistake.sentence)
        yield Text(text=_remedy(mistake))
        for place in mistake.places or ():
            yield Text(text=place.words)
        if mistake.alternatives:
            as_good = "; ".join(other.words for other in mistake.alternatives)
            yield Text(text=f"As good an explanation: {as_good}.")


def _remedy(mistake: MistakeEntry) -> str:
    return f"Change {' or '.join(mistake.change)}; read the run again."


def fit_blocks(section: EstimateSection) -> Iterator[AnyBlock]:
    """Yield how well the model explains the torque of each axis, and what makes a fit doubtful.

    Args:
        section: The estimate.
    """
    yield Table(
        columns=(
            Column(title="axis", is_text=True),
            Column(title="unit", is_text=True),
            Column(title="RMS torque"),
            Column(title="residual (RMS)"),
            Column(title="residual / torque", unit="%", digits=3),
            Column(title="residual / noise", digits=2),
            Column(title="fit", is_text=True),
        ),
        rows=tuple(
            (
                axis.joint,
                axis.unit,
                axis.torque,
                axis.residual,
                axis.percent,
                axis.over_noise,
                axis.grade or "–",
            )
            for axis in section.axes
        ),
        failed=tuple(axis.grade is Grade.BAD for axis in section.axes),
    )
    yield from doubt_texts(section.axes)


def parameter_table(section: EstimateSection) -> Table:
    """Return the parameters with their intervals; of a simulated robot with the true values.

    Args:
        section: The estimate.
    """
    columns = [
        Column(title="#"),
        Column(title="parameter", is_text=True),
        Column(title="estimate ± 2σ"),
        Column(title="unit", is_text=True),
        Column(title="σ from noise", digits=2),
        Column(title="σ from residuals", digits=2),
    ]
    if section.has_truth:
        columns += [Column(title="truth"), Column(title="inside 2σ", is_text=True)]
    return Table(
        columns=tuple(columns),
        rows=tuple(
            _parameter(i, each, has_truth=section.has_truth)
            for i, each in enumerate(section.parameters, start=1)
        ),
        failed=tuple(each.inside_two_sigma is False for each in section.parameters),
        key=2,
    )


def _parameter(place: int, each: ParameterEntry, *, has_truth: bool) -> tuple[Cell, ...]:
    reach = None if each.at_bound or each.not_shown else 2.0 * each.std
    value: Cell
    if reach is None:
        value = f"{number(each.value)}, {'at its bound' if each.at_bound else 'not shown'}"
    else:
        value = Interval(value=each.value, reach=reach)
    row = (place, each.words, value, unit(each.unit), each.std_noise, each.std_residual)
    if not has_truth:
        return row
    inside = {None: "–", True: "yes", False: "NO"}[each.inside_two_sigma]
    return (*row, measured(each.truth, reach)[0], inside)


def finding_texts(section: EstimateSection) -> Iterator[Text]:
    """Yield what a person should know of the estimate.

    Args:
        section: The estimate.
    """
    if section.unseen:
        yield Text(text=f"Without any effect on the torques: {', '.join(section.unseen)}.")
    for finding in section.findings or ():
        yield Text(text=finding)
    if section.mistakes == ():
        yield Text(text="No common mistake of wiring, units or files explains the data far better.")
