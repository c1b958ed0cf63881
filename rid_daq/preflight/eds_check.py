"""What the preflight has to say of the drives' electronic data sheets, before a drive is asked."""

from __future__ import annotations

from config.cell.cell import CellConfig, DriveAxis
from config.cell.servo_profile import ServoProfile
from config.errors import PreflightError
from config.formats.eds import ElectronicDataSheet
from config.load import LoadedCell, bundled_names, load_bundled_or_path
from drivers.servo.eds_check import EdsFinding, eds_findings
from drivers.servo.eds_fit import fit_eds
from rid_daq.preflight.bus_check import CheckLine

MOST_TOLD = 4

_ADVICE = (
    "by its data sheet this drive cannot do what it is needed for: name the EDS of this drive and"
    " firmware in eds, or leave eds out of the axis if the drive is right and its EDS is wrong"
)


def eds_lines(loaded: LoadedCell) -> list[CheckLine]:
    """Return every data sheet with its SHA-256, and what is wrong with it; nothing without any."""
    lines = []
    for axis, eds in _eds_files(loaded):
        findings = eds_findings(eds, loaded.config, axis)
        red = _red(findings)
        action = f"{eds.name}: {_advice(eds, loaded.config, axis)}" if red else ""
        lines.append(
            CheckLine(
                where=_where(axis),
                what="data sheet (EDS)",
                required="has what is used",
                found=(f"lacks {len(red)} of it" if red else "as required") + _unread(eds),
                verdict="red" if red else "ok",
                next_action=action,
                of_drive=True,
            )
        )
        lines += [_line(axis, eds, finding) for finding in findings]
    hashes = {eds.name: eds.sha256 for _, eds in _eds_files(loaded)}
    lines += [
        CheckLine(name, f"SHA-256 of {name}", "", sha256, "shown")
        for name, sha256 in hashes.items()
    ]
    return lines


def _advice(eds: ElectronicDataSheet, cell: CellConfig, axis: DriveAxis) -> str:
    """Return what to do about a data sheet: the keys that the axis lacks, if they are enough."""
    names = bundled_names("servos")
    profiles = {name: load_bundled_or_path(name, "servos", ServoProfile) for name in names}
    fit = fit_eds(eds, cell, axis, profiles)
    if not fit.accepted:
        return _ADVICE
    keys = ", ".join(f"{key}: {value}" for key, value in fit.keys.items())
    return f"say what its drive does not, with the right numbers: servo: {{{keys}}} in the axis"


def refuse_unfit_eds(loaded: LoadedCell) -> None:
    """Refuse a cell whose data sheets say that a drive cannot do what it is needed for.

    Raises:
        PreflightError: Naming the first objects, and how many more there are.
    """
    told = [
        f"{_where(axis)}: {_place(eds, finding)}: {finding.object_name} {finding.name} is"
        f" {finding.found}, required: {finding.required}"
        for axis, eds in _eds_files(loaded)
        for finding in _red(eds_findings(eds, loaded.config, axis))
    ]
    if told:
        more = f"; and {len(told) - MOST_TOLD} more" if len(told) > MOST_TOLD else ""
        raise PreflightError(
            f"{'; '.join(told[:MOST_TOLD])}{more}. Nothing was asked of the drives: {_ADVICE};"
            " `rid-daq check` lists all",
            code="RID-EDS-UNFIT",
        )


def _eds_files(loaded: LoadedCell) -> list[tuple[DriveAxis, ElectronicDataSheet]]:
    pairs = zip(loaded.config.axes, loaded.eds_files, strict=bool(loaded.eds_files))
    return [(axis, eds) for axis, eds in pairs if eds is not None]


def _red(findings: tuple[EdsFinding, ...]) -> list[EdsFinding]:
    return [finding for finding in findings if finding.verdict == "red"]


def _where(axis: DriveAxis) -> str:
    return f"{axis.joint}, node {axis.node_id}"


def _unread(eds: ElectronicDataSheet) -> str:
    """Say how many values of objects that are not used cannot be read."""
    lines = ", ".join(str(fault.line) for fault in eds.faults[:MOST_TOLD])
    more = ", ..." if len(eds.faults) > MOST_TOLD else ""
    return f"; values that cannot be read in lines {lines}{more}" if lines else ""


def _place(eds: ElectronicDataSheet, finding: EdsFinding) -> str:
    return f"{eds.name}:{finding.line}" if finding.line else eds.name


def _line(axis: DriveAxis, eds: ElectronicDataSheet, finding: EdsFinding) -> CheckLine:
    return CheckLine(
        where=_where(axis),
        what=f"data sheet: {finding.object_name} {finding.name}",
        required=finding.required,
        found=finding.found,
        verdict=finding.verdict,
        next_action=f"see {_place(eds, finding)}" if finding.verdict == "red" else "",
        of_drive=True,
    )
