"""What a person does about an object of a drive that is red: by which it is, and what is wrong.

An object that the drive does not have wants another key in the axis's `servo`; one that it does not
let be written wants the drive's own tool, or a cell file that asks for what it holds; one that
holds something else although it may be written, its manual.
"""

from __future__ import annotations

from typing import Final

from drivers.interfaces.servo_axes import DriveSetting

_WATCH = (
    "this drive would not stop when this computer dies: set {object} in the drive's own tool, or"
    " name its node in drive_safety.allow_drive_without_watchdog"
)
_ANOTHER_DRIVE = (
    "this is another drive than the data sheet (eds) or identity of the axis says: see that"
    " the right drive has this node id, or name the EDS of this drive and firmware; where that is"
    " known to do, identity says what the drive may answer"
)

_ALWAYS: Final[dict[str, str]] = {
    "100C": _WATCH,
    "100D": _WATCH,
    "1016": _WATCH,
    "1018": _ANOTHER_DRIVE,
    "6007": _WATCH,
    "6091": "the drive's gear ratio is another than the robot file's: correct the joint's"
    " gear_ratio, or the node ids, if two drives are swapped",
    "6502": "the drive does not list this mode: name mode: profile_velocity in the axis's servo, or"
    " the drive's profile",
    "60B2": "the drive adds a torque of its own: set 60B2h to 0 in its own tool",
    "607E": "the drive turns its counts round by itself: set 607Eh to 0 in its own tool, and let"
    " direction in the axis say how it turns",
}
REPLACED_BY: Final[dict[str, str]] = {
    "1016": "name watch: life_guarding in the axis's servo, where the drive has 100Ch and 100Dh",
    "1017": "name watch: life_guarding in the axis's servo, where the drive has 100Ch and 100Dh",
    "608F": "name encoder_increments, of the motor's encoder, in the axis's servo",
    "6076": "name rated_torque_nm, of the motor's data sheet, in the axis's servo",
    "6075": "name rated_current_a, of the motor's data sheet, in the axis's servo",
    "6072": "name torque_limit: null, or the drive's own limit, in the axis's servo",
    "60FF": "name mode: cyclic_position, or interpolated_position, in the axis's servo",
    "6077": "name torque, the object that tells it or the current, in the axis's servo",
    "60C2": "name cycle_time_written: false in the axis's servo, if the drive's manual says that it"
    " takes the period from SYNC; or mode: profile_velocity, if it has that mode",
    "6085": "name deceleration_rad_s2, of the joint, as the drive's own tool has it, in the axis's"
    " servo",
}
_FIXED_PDOS = (
    "the drive does not let its PDOs be mapped: name in the axis's servo what they carry (pdos), or"
    " the drive's profile"
)
_NO_SYNC = "the drive's RPDOs know no SYNC: name commands: on_arrival in the axis's servo"
_SETTING: Final[dict[str, str]] = {
    "605A": "drive_safety.quick_stop_option",
    "605E": "drive_safety.fault_reaction_option",
    "6065": "drive_safety.following_error_rad",
    "6066": "drive_safety.following_error_timeout_ms",
    "6072": "drive_safety.torque_limit_fraction",
    "6084": "drive_safety.quick_stop_deceleration_rad_s2",
    "6085": "drive_safety.quick_stop_deceleration_rad_s2",
    "60C2": "cycle_time_ms",
}


def next_action(setting: DriveSetting) -> str:
    """Return what to do about a setting that is red.

    Args:
        setting: As `CanServoAxes.settings` has it.
    """
    index = setting.object_name[:4].upper()
    key = _SETTING.get(index)
    if setting.next_action:
        return setting.next_action
    if index in _ALWAYS:
        always = _ALWAYS[index].format(object=f"{index}h")
        missing = index in REPLACED_BY and "not in this drive" in setting.found
        return f"{always}; or {REPLACED_BY[index]}" if missing else always
    if "not in this drive" in setting.found:
        otherwise = "the drive does not have this object: name its profile, or what stands for the"
        return REPLACED_BY.get(index, f"{otherwise} object, in the axis's servo")
    if index in ("608F", "6075", "6076"):
        return REPLACED_BY[index]
    if index[:2] == "14" and setting.object_name.endswith(":02"):
        return _NO_SYNC
    if index[:2] in ("16", "1A") and "read-only" in setting.found:
        return _FIXED_PDOS
    if "read-only" in setting.found:
        ask = f", or let {key} ask for what it holds" if key else ""
        return f"the drive does not let this be written: set it in the drive's own tool{ask}"
    if key:
        return f"change {key}, or the drive"
    return "the drive did not take this setting: see its manual, or set it in its own tool"
