"""Find mistakes in wiring, units and files that explain a misfit, and the keys to change."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from acquisition.processing.smoothing import SmoothedSignals
from acquisition.processing.torque_channel import TorqueChannel
from acquisition.runs.folder import RunFolder
from config.robot.robot import RobotDescription
from identification.equations.bus_delay import longest_delay_s
from identification.estimation.estimate import Estimate
from identification.wiring.mistakes import DEGREES, Mistake, MistakeKind
from identification.wiring.moved_mass import moved_masses
from identification.wiring.scale import ABSOLUTE
from identification.wiring.search import FoundMistake, find_impossibilities, find_mistakes
from identification.wiring.signals import WiredSignals
from identification.wiring.unconfirmed import unconfirmed_entries
from rid_daq.blocks.formats import number
from rid_daq.operations.estimation.run_estimation import EstimationJob, signals_of
from rid_daq.operations.estimation.wiring_findings import (
    OTHER_ROBOT,
    WiringDiagnosis,
    delay_words,
)
from rid_daq.report.mistake_entry import (
    Explanation,
    MistakeEntry,
    PlaceToChange,
    join_words,
)
from rid_daq.runs.origins import key_lines
from rid_daq.runs.run_data import RunData

SMALL_RESIDUAL_SHARE: Final = 0.02
"""If no joint's residual exceeds this fraction of its torque, no fine search is needed."""

_IN_MAP: Final[dict[MistakeKind, str]] = {
    MistakeKind.POSITION_SIGN: "map: `position_sign` of {each}",
    MistakeKind.TORQUE_SIGN: "map: `torque_sign` of {each}",
    MistakeKind.DIRECTION: "map: `position_sign` and `torque_sign` of {each}",
    MistakeKind.POSITION_FACTOR: "map: `units.position`, or `gear_ratio` of {each}",
    MistakeKind.POSITION_OFFSET: "map: `zero_offset` of {each}",
    MistakeKind.POSITION_ORDER: "map: `position` of {each}",
    MistakeKind.TORQUE_FACTOR: "map: `units`, or `torque_constant_nm_per_a` of {each}",
    MistakeKind.TORQUE_ORDER: "map: `torque` or `current` of {each}",
    MistakeKind.AXIS_ORDER: "map: the columns of {each}",
    MistakeKind.CLOCK: "map: `time.unit`, or `rate_hz`",
    MistakeKind.TORQUE_TIME: "the logger: the time stamps of its torques, and its filters",
    MistakeKind.CONVENTION: "robot file: `kinematics.convention`",
    MistakeKind.COUPLING: "robot file: `coupling`",
    MistakeKind.MOUNTING: "robot file: `gravity_m_s2`",
    MistakeKind.KINEMATICS: "robot file: `kinematics`",
    MistakeKind.TORQUE_UNIT: (
        "map: `units`, or `torque_constant_nm_per_a` of {each}; robot file: `cad`"
    ),
    MistakeKind.TORQUE_QUANTITY: "map: `torque` or `current` of {each}",
    MistakeKind.GRAVITY_REMOVED: (
        "map: `torque` or `current` of {each}; the controller: record the torques"
        " of the motors, before gravity is compensated"
    ),
}
_LINES_OF_MAP: Final[dict[MistakeKind, tuple[str, ...]]] = {
    MistakeKind.POSITION_SIGN: ("map.yaml joints.*.position_sign",),
    MistakeKind.TORQUE_SIGN: ("map.yaml joints.*.torque_sign",),
    MistakeKind.DIRECTION: ("map.yaml joints.*.position_sign", "map.yaml joints.*.torque_sign"),
    MistakeKind.POSITION_FACTOR: ("map.yaml units.position", "map.yaml joints.*.gear_ratio"),
    MistakeKind.POSITION_OFFSET: ("map.yaml joints.*.zero_offset",),
    MistakeKind.POSITION_ORDER: ("map.yaml joints.*.position",),
    MistakeKind.TORQUE_FACTOR: ("map.yaml units", "map.yaml joints.*.torque_constant_nm_per_a"),
    MistakeKind.TORQUE_ORDER: ("map.yaml joints.*.torque", "map.yaml joints.*.current"),
    MistakeKind.AXIS_ORDER: ("map.yaml joints.*.position",),
    MistakeKind.CLOCK: ("map.yaml time.unit", "map.yaml rate_hz"),
    MistakeKind.TORQUE_TIME: (),
    MistakeKind.TORQUE_UNIT: ("map.yaml units", "map.yaml joints.*.torque_constant_nm_per_a"),
    MistakeKind.TORQUE_QUANTITY: ("map.yaml joints.*.torque", "map.yaml joints.*.current"),
    MistakeKind.GRAVITY_REMOVED: ("map.yaml joints.*.torque", "map.yaml joints.*.current"),
}
_LINES_OF_ROBOT: Final[dict[MistakeKind, tuple[str, ...]]] = {
    MistakeKind.CONVENTION: ("robot.yaml kinematics.convention",),
    MistakeKind.COUPLING: ("robot.yaml coupling",),
    MistakeKind.MOUNTING: ("robot.yaml gravity_m_s2",),
    MistakeKind.KINEMATICS: ("robot.yaml kinematics.rows",),
}
_LINES_OF_CELL: Final[dict[MistakeKind, tuple[str, ...]]] = {
    MistakeKind.POSITION_SIGN: (
        "robot.yaml kinematics.rows.*.alpha_rad",
        "cell.yaml axes.*.direction",
    ),
    MistakeKind.TORQUE_SIGN: ("cell.yaml axes.*.direction",),
    MistakeKind.DIRECTION: ("cell.yaml axes.*.direction",),
    MistakeKind.POSITION_FACTOR: ("robot.yaml joints.*.gear_ratio",),
    MistakeKind.POSITION_OFFSET: (
        "cell.yaml axes.*.position_zero_counts",
        "robot.yaml kinematics.rows.*.theta_rad",
    ),
    MistakeKind.POSITION_ORDER: ("cell.yaml axes.*.node_id",),
    MistakeKind.TORQUE_FACTOR: ("robot.yaml joints.*.gear_ratio",),
    MistakeKind.TORQUE_ORDER: ("cell.yaml axes.*.node_id",),
    MistakeKind.AXIS_ORDER: ("cell.yaml axes.*.node_id",),
    MistakeKind.CLOCK: ("cell.yaml cycle_time_ms",),
    MistakeKind.TORQUE_TIME: (),
    MistakeKind.TORQUE_UNIT: ("robot.yaml joints.*.gear_ratio",),
    MistakeKind.TORQUE_QUANTITY: (),
    MistakeKind.GRAVITY_REMOVED: (),
}
ALONG_AXIS: Final = math.cos(math.radians(2.0))
_NEVER_ADDED: Final = frozenset({"torque", "current", "rate_hz", "time.unit"})
"""Keys of a map that have an alternative; if such a key is missing, it must not be added."""

_TORQUE_OBJECT: Final = "the drive: the quantity in its torque object (6077h in most drives)"

_IN_CELL: Final[dict[MistakeKind, str]] = {
    MistakeKind.POSITION_SIGN: (
        "robot file: the sign of `alpha_rad` in {rows}; cell file: `direction` in {axes}"
    ),
    MistakeKind.TORQUE_SIGN: (
        "cell file: `direction` in {axes}; the drive: the sign of its torque (6077h)"
    ),
    MistakeKind.DIRECTION: "cell file: `direction` in {axes}",
    MistakeKind.POSITION_FACTOR: "robot file: `gear_ratio` in {joints}; the drive: its encoder's"
    " resolution (608Fh)",
    MistakeKind.POSITION_OFFSET: (
        "cell file: `position_zero_counts` in {axes}; robot file: `theta_rad` in {rows}"
    ),
    MistakeKind.POSITION_ORDER: "cell file: `node_id` in {axes}",
    MistakeKind.TORQUE_FACTOR: (
        "robot file: `gear_ratio` in {joints}; the drive: its rated torque (6076h)"
    ),
    MistakeKind.TORQUE_ORDER: "cell file: `node_id` in {axes}",
    MistakeKind.AXIS_ORDER: "cell file: `node_id` in {axes}",
    MistakeKind.CLOCK: "cell file: `cycle_time_ms`",
    MistakeKind.TORQUE_TIME: "the drives: the filters of their torque object (6077h)",
    MistakeKind.CONVENTION: "robot file: `kinematics.convention`",
    MistakeKind.COUPLING: "robot file: `coupling`",
    MistakeKind.MOUNTING: "robot file: `gravity_m_s2`",
    MistakeKind.KINEMATICS: "robot file: `kinematics`",
    MistakeKind.TORQUE_UNIT: (
        "cell file: the rated torque of {axes}; the drive: its rated torque (6076h)"
    ),
    MistakeKind.TORQUE_QUANTITY: _TORQUE_OBJECT,
    MistakeKind.GRAVITY_REMOVED: _TORQUE_OBJECT,
}


def signals_for_diagnosis(
    data: Sequence[RunData],
    how: EstimationJob,
    robot: RobotDescription,
    smoothed: Sequence[SmoothedSignals] = (),
    channel: TorqueChannel | None = None,
) -> WiredSignals:
    """Return the signals in which mistakes are searched for.

    Runs in which the robot carried an unknown payload or known bodies are left out. The torques
    are not converted to rigid gears, because mistakes make the model for a conversion wrong.

    Args:
        data: The runs; all are periodic, or none.
        how: Options of the estimate; only its highest frequency and its runs with a load are used.
        robot: The robot as its file describes it.
        smoothed: Result of `smoothed_runs` for all runs, if it is known.
        channel: Delays and filters of the torques that the estimate contains.
    """
    empty = how.empty_runs(data)
    own = [each for each, item in zip(smoothed, data, strict=False) if item in empty]
    return WiredSignals.of(robot, signals_of(empty, how, channel, own))


def diagnose_wiring(
    signals: WiredSignals, run: RunData, estimate: Estimate | None = None, *, search: bool = True
) -> WiringDiagnosis:
    """Find physically impossible properties of runs, and probable mistakes in their files.

    Args:
        signals: Signals of the runs of one robot.
        run: One of the runs; its folder contains the files.
        estimate: Estimate from these runs; if its residual is small, the fine search is skipped.
        search: True to try the common mistakes of wiring, units and files.
    """
    driving, weight = find_impossibilities(signals)
    masses = moved_masses(signals)
    if not search:
        return WiringDiagnosis(None, driving, weight, masses)
    imported, folder = run.import_report is not None, run.folder
    longest_s = longest_delay_s(float(np.median(np.diff(run.recording.time_s))))
    mistakes, late_s = [], 0.0
    for each in find_mistakes(signals, fine=_hides_mistakes(estimate)):
        if 0.0 < abs(each.mistake.delay_s) <= longest_s:
            late_s = each.mistake.delay_s
        else:
            mistakes.append(mistake_entry(each, signals.robot, imported=imported, folder=folder))
    unconfirmed = None if mistakes or late_s else unconfirmed_entries(signals)
    return WiringDiagnosis(tuple(mistakes), driving, weight, masses, unconfirmed, late_s)


def _hides_mistakes(estimate: Estimate | None) -> bool:
    """Return True if a joint's residual exceeds `SMALL_RESIDUAL_SHARE` of its torque."""
    if estimate is None or estimate.torque_nm is None:
        return True
    return bool((estimate.residual_nm > SMALL_RESIDUAL_SHARE * estimate.torque_nm).any())


def mistake_entry(
    found: FoundMistake, robot: RobotDescription, *, imported: bool, folder: RunFolder | None = None
) -> MistakeEntry:
    """Return a mistake as a section of a report, with the keys to change.

    Args:
        found: The mistake and its alternatives.
        robot: Robot with the names of the joints.
        imported: True if an import map describes the recording; otherwise a cell file does.
        folder: Run folder with the files to change.
    """
    best, *others = (
        Explanation(
            kind=each.kind,
            joints=tuple(robot.joint_names[j] for j in each.joints),
            factor=each.factor,
            words=_mistake_phrase(each, robot),
            change=_keys_to_change(each, robot, imported),
            places=None if folder is None else _lines_to_change(each, robot, imported, folder),
        )
        for each in (found.mistake, *found.alternatives)
    )
    gains = found.times_better
    worst = max(range(len(gains)), key=lambda j: _finite_or_zero(float(gains[j])))
    return MistakeEntry.from_attributes(
        best,
        times_better=_finite_or_zero(float(gains[worst])),
        sentence=_mistake_sentence(found, best.words, robot.joint_names, worst),
        alternatives=tuple(others),
    )


def _mistake_sentence(found: FoundMistake, words: str, joints: Sequence[str], worst: int) -> str:
    """Return a mistake as a sentence, with its evidence."""
    mistake = f"{words[0].upper()}{words[1:]}"
    if found.weight is not None:
        return f"{mistake}: {found.weight.sentence}."
    if found.mistake.kind is MistakeKind.TORQUE_QUANTITY:
        if found.mistake.what == ABSOLUTE:
            return f"{mistake}: no value is negative, although the joints move in both directions."
        return f"{mistake}: the values agree in every row."
    if found.held_out_ratio is not None:
        less = 100.0 * (1.0 - found.held_out_ratio)
        sentence = (
            f"{mistake}: if this mistake is corrected, the squared error on held-out parts of the"
            f" recording falls by {less:.0f} %."
        )
        is_table = found.mistake.kind is MistakeKind.KINEMATICS
        return f"{sentence} {OTHER_ROBOT}" if is_table else sentence
    sentence = f"{mistake}: if this mistake is corrected, the model fits the data far better."
    before, after = (100.0 * trial.residual_share[worst] for trial in (found.before, found.after))
    if before >= 1.2 * after:
        sentence += (
            f" The residual of {joints[worst]} falls from {before:.0f} to {after:.0f} % of the"
            " torque."
        )
    if found.before.driving.any() and not found.after.driving.any():
        driven = join_words([joints[j] for j in np.flatnonzero(found.before.driving).tolist()])
        sentence += f" Without correction, the friction of {driven} has negative power."
    return sentence


def _finite_or_zero(value: float) -> float:
    return value if math.isfinite(value) else 0.0


def _lines_to_change(
    mistake: Mistake, robot: RobotDescription, imported: bool, folder: RunFolder
) -> tuple[PlaceToChange, ...]:
    """Return the lines in a run's files that can contain the mistake."""
    patterns_by_kind = {**(_LINES_OF_MAP if imported else _LINES_OF_CELL), **_LINES_OF_ROBOT}
    patterns = patterns_by_kind[mistake.kind]
    joints = mistake.changed
    wanted = [
        pattern.replace("*", str(j))
        for pattern in patterns
        for j in (joints if "*" in pattern else (0,))
    ]
    lines = key_lines(folder, wanted, robot.joint_names)
    return tuple(
        PlaceToChange.from_attributes(each, words=str(each))
        for each in lines
        if each.stated or each.key not in _NEVER_ADDED
    )


def _keys_to_change(mistake: Mistake, robot: RobotDescription, imported: bool) -> tuple[str, ...]:
    text = (_IN_MAP if imported else _IN_CELL)[mistake.kind]
    joints = mistake.changed

    def listed(of: str) -> str:
        return ", ".join(f"{of}[{j}]" for j in joints)

    names = ", ".join(f"joints[{j}] ({robot.joint_names[j]})" for j in joints)
    filled = text.format(
        each=names, joints=listed("joints"), axes=listed("axes"), rows=listed("kinematics.rows")
    )
    return tuple(filled.split("; "))


def _mistake_phrase(mistake: Mistake, robot: RobotDescription) -> str:
    """Return the mistake as a sentence without the full stop at its end."""
    names = [robot.joint_names[j] for j in mistake.joints]
    joint = join_words(names) if names else "every joint"
    each = joint if len(names) == 1 else f"{joint} each"
    in_order = f"come in the order {', '.join(names)}"
    order = f"{joint} are swapped" if len(names) == 2 else f"the joints {in_order}"
    axes = f"the axes {joint} are swapped" if len(names) == 2 else f"the axes {in_order}"
    phrases: dict[MistakeKind, Callable[[], str]] = {
        MistakeKind.POSITION_SIGN: lambda: f"the position of {joint} has the wrong sign",
        MistakeKind.TORQUE_SIGN: lambda: f"the torque of {joint} has the wrong sign",
        MistakeKind.DIRECTION: lambda: f"the direction of {joint} in the file is reversed",
        MistakeKind.POSITION_FACTOR: lambda: _factor_phrase(
            f"the position of {joint}", mistake, robot
        ),
        MistakeKind.POSITION_OFFSET: lambda: (
            f"the zero position of {joint} is wrong: add {math.degrees(mistake.factor):.3g}° to"
            " its position"
        ),
        MistakeKind.POSITION_ORDER: lambda: f"the positions of {order}",
        MistakeKind.TORQUE_FACTOR: lambda: _factor_phrase(f"the torque of {joint}", mistake, robot),
        MistakeKind.TORQUE_ORDER: lambda: f"the torques of {order}",
        MistakeKind.TORQUE_UNIT: lambda: f"the torques are in {mistake.what}",
        MistakeKind.TORQUE_QUANTITY: lambda: (
            f"the torque column of {each} contains its {mistake.what}"
        ),
        MistakeKind.AXIS_ORDER: lambda: axes,
        MistakeKind.CLOCK: lambda: (
            f"one second of the time stamps lasts {number(mistake.factor, 3)} s"
        ),
        MistakeKind.TORQUE_TIME: lambda: (
            f"all torques are {delay_words(mistake.delay_s)}"
            + (", or pass a filter with this delay" if mistake.delay_s > 0.0 else "")
        ),
        MistakeKind.CONVENTION: lambda: (
            f"the kinematic table uses another convention than {robot.kinematics.convention}"
        ),
        MistakeKind.COUPLING: lambda: (
            f"the coupling of the wrist at {joint} differs from the robot file"
            if robot.coupling is not None
            else f"the wrist is coupled at {joint}"
        ),
        MistakeKind.MOUNTING: lambda: (
            f"gravity points along {_gravity_direction(mistake.robot, robot)}"
        ),
        MistakeKind.GRAVITY_REMOVED: lambda: "gravity is missing in the torques",
        MistakeKind.KINEMATICS: lambda: mistake.what,
    }
    return phrases[mistake.kind]()


def _gravity_direction(right: RobotDescription | None, stated: RobotDescription) -> str:
    """Return the direction of gravity in the base's frame, compared with that in the robot file."""
    gravity = np.array(stated.gravity_m_s2 if right is None else right.gravity_m_s2)
    unit = gravity / np.linalg.norm(gravity)
    axis = int(np.argmax(np.abs(unit)))
    if abs(unit[axis]) > ALONG_AXIS:
        return f"{'-' if unit[axis] < 0.0 else '+'}{'xyz'[axis]} of the base"
    before = np.array(stated.gravity_m_s2)
    tilt = math.degrees(math.acos(float(unit @ before / np.linalg.norm(before))))
    along = ", ".join(f"{value:.2f}" for value in gravity)
    return f"[{along}] m/s² of the base, {tilt:.0f}° from the direction in the robot file"


def _factor_phrase(what: str, mistake: Mistake, robot: RobotDescription) -> str:
    if mistake.kind is MistakeKind.POSITION_FACTOR and mistake.factor == DEGREES:
        return f"{what} is in degrees"
    if mistake.kind is MistakeKind.POSITION_FACTOR and mistake.factor == 1.0 / DEGREES:
        return f"{what} is in radians"
    if mistake.what:
        return f"{what} is {mistake.what}"
    gear = abs(robot.joints[mistake.joints[0]].gear_ratio) if mistake.joints else 1.0
    if gear != 1.0 and mistake.factor in (gear, 1.0 / gear):
        return f"{what} is measured on the other side of the gear ({gear:g})"
    return f"{what} must be multiplied by {number(mistake.factor, 3)}"
