"""`SdoPort`: access to one node's objects over a `CanLink` before the cyclic exchange."""

from __future__ import annotations

import contextlib
from collections.abc import Callable

from config.errors import ProtocolError
from drivers.canopen.frames import Frame, sdo_answer_cob_id
from drivers.canopen.sdo import SdoAbort, SdoCode, abort_text, object_name
from drivers.canopen.sdo_client import SdoClient
from drivers.ports.can_link import CanLink
from drivers.settings.saved_drive import Address, DriveIdentity
from drivers.settings.write_log import WriteLog

MISSING = (SdoCode.NO_OBJECT, SdoCode.NO_SUBINDEX)


class SdoPort:
    """SDO transfers with one node; each call waits for the answer, and passes other frames on.

    Args:
        link: The bus.
        node_id: The drive.
        others: Handler of each frame that is not an answer of this node's SDO server, with its time
            [s].
        timeout_s: Longest wait for each answer [s]. No request is repeated.
        write_log: Log of the values that are written, with the previous values; None without a log.
    """

    def __init__(
        self,
        link: CanLink,
        node_id: int,
        others: Callable[[Frame, float], None],
        timeout_s: float = 0.5,
        write_log: WriteLog | None = None,
    ) -> None:
        self.node_id = node_id
        self._link = link
        self._others = others
        self._write_log = write_log
        self._client = SdoClient(node_id, timeout_s)
        self._answer_cob_id = sdo_answer_cob_id(node_id)

    def read(self, index: int, subindex: int) -> bytes:
        """Return an object's bytes.

        Raises:
            SdoAbort: The drive refuses the request.
            DeviceTimeoutError: The drive does not answer.
            TransportError: The bus is lost.
        """
        return self._run(self._client.upload(index, subindex, self._link.clock.now_s()))

    def write(self, index: int, subindex: int, data: bytes) -> None:
        """Write an object; raise errors as `read` does.

        Raises:
            RecordingError: The write log cannot be written; the object in the drive was not
                changed.
        """
        if self._write_log is not None:
            try:
                old: bytes | str = self.read(index, subindex)
            except SdoAbort as abort:
                old = abort_text(abort.code)
            self.log_change(self._write_log, (index, subindex), old, data)
        self._run(self._client.download(index, subindex, data, self._link.clock.now_s()))

    def read_int(self, index: int, subindex: int, *, signed: bool = False) -> int:
        """Return the value of an integer object of 1 to 8 bytes; raise errors as `read` does."""
        data = self.read(index, subindex)
        if not 1 <= len(data) <= 8:
            raise ProtocolError(
                f"node {self.node_id}: object {object_name(index, subindex)} has {len(data)} bytes,"
                " but a number was expected",
                code="RID-DRIVE-DATA-SIZE",
            )
        return int.from_bytes(data, "little", signed=signed)

    def identity(self) -> DriveIdentity:
        """Return the parts of 1018h that the drive has; raise errors as `read`, not `SdoAbort`."""
        parts: dict[str, int] = {}
        for subindex, name in enumerate(("vendor", "product", "revision", "serial"), start=1):
            with contextlib.suppress(SdoAbort):
                parts[name] = self.read_int(0x1018, subindex)
        return DriveIdentity(**parts)

    def log_change(
        self, write_log: WriteLog, address: Address, old: bytes | str, new: bytes | None
    ) -> None:
        """Log a change before it reaches the drive; raise errors as `read` and `write` do."""
        if not write_log.knows(self.node_id):
            write_log.add_drive(self.node_id, self.identity())
        write_log.add_change(self.node_id, address, old, new)

    def _run(self, request: Frame) -> bytes:
        self._link.send(request)
        client = self._client
        while not client.done:
            frame = self._link.receive(client.deadline_s)
            if frame is None:
                reply = client.check(self._link.clock.now_s())
            elif frame.cob_id == self._answer_cob_id:
                reply = client.handle(frame, self._link.last_time_s)
            else:
                self._others(frame, self._link.last_time_s)
                reply = client.check(self._link.last_time_s)
            if reply is not None:
                self._link.send(reply)
        return client.result()


def is_missing(abort: SdoAbort) -> bool:
    """Return True if the abort code means that the drive does not have the object."""
    return abort.code in MISSING


def explain_abort(abort: SdoAbort) -> str:
    """Return the reason of an abort; a missing object has its own words."""
    return "not in this drive" if is_missing(abort) else abort_text(abort.code)
