"""NMT: the states of a CANopen node and its state commands (CiA 301, 7.2.8 and 7.3.2)."""

from __future__ import annotations

from enum import IntEnum

from drivers.canopen.frames import NMT_COB_ID, Frame

ALL_NODES = 0


class NmtState(IntEnum):
    """NMT states; the values are those in boot-up and heartbeat messages."""

    INITIALISING = 0x00
    STOPPED = 0x04
    OPERATIONAL = 0x05
    PRE_OPERATIONAL = 0x7F


class NmtCommand(IntEnum):
    """NMT commands; the values are the command specifiers of CiA 301."""

    START = 0x01
    STOP = 0x02
    ENTER_PRE_OPERATIONAL = 0x80
    RESET_NODE = 0x81
    RESET_COMMUNICATION = 0x82


_AFTER = {
    NmtCommand.START: NmtState.OPERATIONAL,
    NmtCommand.STOP: NmtState.STOPPED,
    NmtCommand.ENTER_PRE_OPERATIONAL: NmtState.PRE_OPERATIONAL,
    NmtCommand.RESET_NODE: NmtState.INITIALISING,
    NmtCommand.RESET_COMMUNICATION: NmtState.INITIALISING,
}


def nmt_frame(command: NmtCommand, node_id: int = ALL_NODES) -> Frame:
    """Return the master's command to one node; node id 0 means all nodes."""
    return Frame(NMT_COB_ID, bytes((command, node_id)))


def parse_nmt(frame: Frame, node_id: int) -> NmtCommand | None:
    """Return the NMT command to a node in a frame; None if the frame contains no such command."""
    if frame.cob_id != NMT_COB_ID or len(frame.data) != 2:
        return None
    command, addressed = frame.data
    if addressed not in (ALL_NODES, node_id):
        return None
    try:
        return NmtCommand(command)
    except ValueError:
        return None


def next_nmt_state(state: NmtState, command: NmtCommand) -> NmtState:
    """Return the state after a command, which a node ignores in INITIALISING (CiA 301, fig. 52)."""
    return state if state is NmtState.INITIALISING else _AFTER[command]


def state_name(number: int) -> str:
    """Return the name of the state in a heartbeat's data byte; its toggle bit is ignored."""
    try:
        return NmtState(number & 0x7F).name.lower().replace("_", "-")
    except ValueError:
        return f"unknown state {number & 0x7F:02X}h"
