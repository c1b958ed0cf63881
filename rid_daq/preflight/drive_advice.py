"""Remedies for red settings of drives, by object and kind of problem.

If a drive lacks an object, the remedy is another key in the axis's `servo`. If an object is
read-only, the remedy is the manufacturer's tool, or a cell file that requires the present value. If
a writable object keeps another value, the remedy is in the drive's manual.
"""

from __future__ import annotations

from typing import Final

from drivers.interfaces.servo_axes import DriveSetting

_WATCH = (
    "this drive would not stop if this computer fails: set {object} with the manufacturer's"
    " tool, or list its node id in drive_safety.allow_drive_without_watchdog"
)
_ANOTHER_DRIVE = (
    "this drive differs from the data sheet (eds) or identity of the axis: check that the right"
    " drive has this node id, or name the EDS of this drive and firmware; if the difference is"
    " known to be harmless, set in identity the answers that the drive may give"
)

_ALWAYS: Final[dict[str, str]] = {
    "100C": _WATCH,
    "100D": _WATCH,
    "1016": _WATCH,
    "1018": _ANOTHER_DRIVE,
    "6007": _WATCH,
    "6091": "the drive's gear ratio differs from the robot file: correct the joint's gear_ratio,"
    " or the node ids if two drives are swapped",
    "6502": "the drive does not support this mode: set mode: profile_velocity in the axis's"
    " servo, or name the drive's profile",
    "60B2": "the drive adds a torque offset: set 60B2h to 0 with the manufacturer's tool",
    "607E": "the drive inverts its counts: set 607Eh to 0 with the manufacturer's tool, and"
    " state the direction of rotation by direction in the axis",
}
REPLACED_BY: Final[dict[str, str]] = {
    "1016": "set watch: life_guarding in the axis's servo, if the drive has 100Ch and 100Dh",
    "1017": "set watch: life_guarding in the axis's servo, if the drive has 100Ch and 100Dh",
    "608F": "set encoder_increments (of the motor's encoder) in the axis's servo",
    "6076": "set rated_torque_nm (from the motor's data sheet) in the axis's servo",
    "6075": "set rated_current_a (from the motor's data sheet) in the axis's servo",
    "6072": "set torque_limit: null, or the drive's own limit, in the axis's servo",
    "60FF": "set mode: cyclic_position, or interpolated_position, in the axis's servo",
    "6077": "set torque in the axis's servo to the object that contains torque or current",
    "60C2": "set cycle_time_written: false in the axis's servo, if the drive's manual says that"
    " it derives the period from SYNC; or mode: profile_velocity, if it has that mode",
    "6085": "set deceleration_rad_s2 in the axis's servo to the deceleration of the joint in the"
    " manufacturer's tool",
}
_FIXED_PDOS = (
    "the drive has a fixed PDO mapping: state in the axis's servo which objects its PDOs carry"
    " (pdos), or name the drive's profile"
)
_NO_SYNC = "the drive's RPDOs do not support SYNC: set commands: on_arrival in the axis's servo"
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
    """Return the remedy for a red setting.

    Args:
        setting: Setting from `CanServoAxes.settings`.
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
        otherwise = (
            "the drive does not have this object: name the drive's profile, or the"
            " object to use instead,"
        )
        return REPLACED_BY.get(index, f"{otherwise} in the axis's servo")
    if index in ("608F", "6075", "6076"):
        return REPLACED_BY[index]
    if index[:2] == "14" and setting.object_name.endswith(":02"):
        return _NO_SYNC
    if index[:2] in ("16", "1A") and "read-only" in setting.found:
        return _FIXED_PDOS
    if "read-only" in setting.found:
        ask = f", or set {key} to the present value" if key else ""
        return f"the object is read-only: set it with the manufacturer's tool{ask}"
    if key:
        return f"change {key}, or use another drive"
    return (
        "the drive did not accept this setting: see its manual, or set it with the"
        " manufacturer's tool"
    )
