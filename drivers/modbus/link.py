"""`ModbusLink`: requests to drives over Modbus, with typed errors and limited waits.

The one place that knows pymodbus. A request is sent once; where no answer comes in time the line is
left alone until a late one must have come too, and that is thrown away: on a serial line nothing
says which request an answer belongs to, and it would be taken for the next one's.
"""

from __future__ import annotations

import contextlib
import logging
import socket
import ssl
import termios
import time
from collections.abc import Callable

import serial
from pymodbus import FramerType
from pymodbus.client import ModbusSerialClient, ModbusTcpClient, ModbusTlsClient
from pymodbus.client.base import ModbusBaseSyncClient
from pymodbus.exceptions import ConnectionException, ModbusException, ModbusIOException

from config.cell.monitor import ModbusRtu, ModbusTcp, ModbusTls, MonitorConfig
from config.errors import DeviceTimeoutError, ProtocolError, TransportError
from drivers.modbus.codec import RegisterRead

LATE_FACTOR = 1.5
"""An answer that is later than this many time-outs is not waited for any more."""

_FUNCTION = {"holding": 3, "input": 4}
_EXCEPTIONS = {
    1: "the function is not known to it",
    2: "it has no such register",
    3: "the request's count is not allowed",
    4: "it failed at it",
    5: "it needs longer",
    6: "it is busy",
    10: "the gateway has no path to it",
    11: "it does not answer its gateway",
}
_SHOWN_BYTES = 8
_PARITY = {"even": "E", "odd": "O", "none": "N"}

logging.getLogger("pymodbus").setLevel(logging.CRITICAL)  # what it has to say is raised here


class Received:
    """Keeps the bytes that came since the last request; given to a client as `trace_packet`."""

    def __init__(self) -> None:
        self.data = b""

    def __call__(self, sending: bool, data: bytes) -> bytes:
        """Take the bytes that are sent, or all that came so far; they are passed on unchanged."""
        if not sending:
            self.data = data
        return data


class ModbusLink:
    """An open line to one or more drives; a context manager.

    Args:
        client: The connected client.
        name: How errors call the line.
        timeout_s: How long an answer may take [s].
        pause: How to let time pass.
        received: Keeps what has come since the last request; the client's `trace_packet`.
    """

    def __init__(
        self,
        client: ModbusBaseSyncClient,
        name: str,
        timeout_s: float,
        pause: Callable[[float], None] = time.sleep,
        received: Received | None = None,
    ) -> None:
        self._client = client
        self._received = received or Received()
        self._timeout_s = timeout_s
        self._pause = pause
        self._serial = isinstance(client, ModbusSerialClient)
        self.name = name

    def read(self, unit: int, read: RegisterRead) -> list[int]:
        """Return the registers of one request.

        Raises:
            DeviceTimeoutError: The drive did not answer in time.
            ProtocolError: It refused, or what came is not an answer to this.
            TransportError: The line is gone.
        """
        client = self._client
        ask = client.read_holding_registers
        if read.table == "input":
            ask = client.read_input_registers
        self._received.data = b""
        try:
            response = ask(read.address, count=read.count, device_id=unit)
        except ConnectionException as error:
            client.close()  # type: ignore[no-untyped-call]
            raise TransportError(
                f"{self.name} cannot be reached; check address, cable and that the drives are on",
                code="RID-MODBUS-OPEN",
            ) from error
        except ModbusIOException as error:
            self._forget_late_answer()
            if "received" in str(error) and "uses" in str(error):
                raise ProtocolError(
                    f"{self.name}, unit {unit}: something else was answered: {error}",
                    code="RID-MODBUS-GARBAGE",
                ) from error
            if garbage := self._received.data:
                shown = garbage[:_SHOWN_BYTES].hex(" ").upper()
                more = " …" if len(garbage) > _SHOWN_BYTES else ""
                raise ProtocolError(
                    f"{self.name}, unit {unit}: {len(garbage)} bytes came that are no Modbus answer"
                    f" ({shown}{more}); compare baud rate, parity and stop bits with the drive's,"
                    " and look at termination and for another sender on the line",
                    code="RID-MODBUS-GARBAGE",
                ) from error
            raise DeviceTimeoutError(
                f"{self.name}, unit {unit}: no answer within {self._timeout_s:g} s; check the"
                " address, the baud rate and the wiring, or raise monitor.timeout_s",
                code="RID-MODBUS-SILENT",
            ) from error
        except (ModbusException, OSError, ValueError) as error:
            self._forget_late_answer()
            raise ProtocolError(
                f"{self.name}, unit {unit}: {error}", code="RID-MODBUS-GARBAGE"
            ) from error
        if response.isError():
            code = int(response.exception_code)
            why = _EXCEPTIONS.get(code, "a code of its maker's own")
            raise ProtocolError(
                f"{self.name}, unit {unit}: registers {read.address} to"
                f" {read.address + read.count - 1} are refused with exception {code}: {why}",
                code="RID-MODBUS-PROFILE",
            )
        if response.function_code != _FUNCTION[read.table] or len(response.registers) != read.count:
            self._forget_late_answer()
            raise ProtocolError(
                f"{self.name}, unit {unit}: {len(response.registers)} registers of function"
                f" {response.function_code} were answered, {read.count} of function"
                f" {_FUNCTION[read.table]} were asked for",
                code="RID-MODBUS-GARBAGE",
            )
        return list(response.registers)

    def close(self) -> None:
        """Close the line."""
        self._client.close()  # type: ignore[no-untyped-call]

    def _forget_late_answer(self) -> None:
        """Make sure that no answer to an old request is taken for one to the next.

        A connection goes with what is still on its way in it; on a serial line it is waited for,
        and the client drops what lies there before it sends.
        """
        if self._serial:
            self._pause((LATE_FACTOR - 1.0) * self._timeout_s)
        else:
            self._client.close()  # type: ignore[no-untyped-call]

    def __enter__(self) -> ModbusLink:
        """Return the link itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the line."""
        self.close()


def open_modbus(config: MonitorConfig, pause: Callable[[float], None] = time.sleep) -> ModbusLink:
    """Open the line that a cell file names.

    Raises:
        TransportError: It cannot be opened, or its certificates cannot be used.
    """
    link = config.link
    if isinstance(link, ModbusRtu):
        name = f"Modbus line {link.address}"
    else:
        name = f"Modbus {link.host}:{link.port}"
    received = Received()
    client = _client(link, config.timeout_s, received)
    try:
        connected = client.connect()
    except (OSError, ssl.SSLError) as error:
        client.close()  # type: ignore[no-untyped-call]
        raise TransportError(
            f"{name} cannot be opened ({error}); check monitor.link", code="RID-MODBUS-OPEN"
        ) from error
    if not connected:
        raise TransportError(
            f"{name} cannot be opened ({_reason(link, config.timeout_s)}); check monitor.link, that"
            " the drives are on and that no other program has the line",
            code="RID-MODBUS-OPEN",
        )
    return ModbusLink(client, name, config.timeout_s, pause, received)


def _reason(link: ModbusTcp | ModbusRtu, timeout_s: float) -> str:
    """Return why a line cannot be opened, which pymodbus writes into its log only."""
    try:
        if isinstance(link, ModbusRtu):
            serial.Serial(
                link.address,
                link.baud_rate,
                parity=_PARITY[link.parity],
                stopbits=link.stop_bits,
                exclusive=True,
            ).close()
        else:
            socket.create_connection((link.host, link.port), timeout_s).close()
    except (OSError, ValueError, termios.error) as error:  # serial's own is an OSError
        return str(error)
    return "it can be opened now: try again"


def _client(
    link: ModbusTcp | ModbusRtu, timeout_s: float, received: Received
) -> ModbusBaseSyncClient:
    if isinstance(link, ModbusRtu):
        return ModbusSerialClient(
            link.address,
            framer=FramerType.RTU,
            baudrate=link.baud_rate,
            parity=_PARITY[link.parity],
            stopbits=link.stop_bits,
            timeout=timeout_s,
            retries=0,
            trace_packet=received,
        )
    if link.tls is None:
        return ModbusTcpClient(
            link.host, port=link.port, timeout=timeout_s, retries=0, trace_packet=received
        )
    return _VerifyingTlsClient(link, link.tls, timeout_s)


class _VerifyingTlsClient(ModbusTlsClient):
    """A client that also holds the drive's certificate against the name it is reached by."""

    def __init__(self, link: ModbusTcp, tls: ModbusTls, timeout_s: float) -> None:
        self._context = _tls_context(tls)
        self._server_name = tls.server_name or link.host
        super().__init__(
            link.host, sslctx=self._context, port=link.port, timeout=timeout_s, retries=0
        )

    def connect(self) -> bool:
        """Connect; raises OSError (of which an SSLError is one) where that fails."""
        if self.socket is None:
            address = (self.comm_params.host, self.comm_params.port)
            timeout_s = self.comm_params.timeout_connect
            with contextlib.ExitStack() as undo:
                plain = undo.enter_context(socket.create_connection(address, timeout_s))
                self.socket = self._context.wrap_socket(plain, server_hostname=self._server_name)
                undo.pop_all()
        return True


def _tls_context(tls: ModbusTls) -> ssl.SSLContext:
    """Return what proves the drives' identity to us, and ours to them where we have one."""
    try:
        context = ssl.create_default_context(ssl.Purpose.SERVER_AUTH, cafile=tls.ca_file)
        context.minimum_version = ssl.TLSVersion.TLSv1_2
        if tls.certificate_file is not None:
            context.load_cert_chain(tls.certificate_file, tls.key_file)
    except (OSError, ssl.SSLError) as error:
        raise TransportError(
            f"monitor.link.tls: a certificate cannot be used ({error}); check its files",
            code="RID-MODBUS-OPEN",
        ) from error
    return context
