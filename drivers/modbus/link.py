"""`ModbusLink`: requests to drives over Modbus, with typed errors and limited waits.

This is the only module that uses pymodbus. No request is repeated. On a serial line an answer does
not identify its request, so a late answer could be mistaken for the answer to the next request.
After a timeout, no request is therefore sent until even a late answer must have arrived; a late
answer is discarded.
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
"""Time after a request, in multiples of the timeout, after which no late answer can arrive."""

_FUNCTION = {"holding": 3, "input": 4}
_EXCEPTIONS = {
    1: "the drive does not support this function",
    2: "the drive has no such register",
    3: "the drive does not allow this number of registers",
    4: "the drive failed to execute the request",
    5: "the drive needs more time",
    6: "the drive is busy",
    10: "the gateway has no path to the drive",
    11: "the drive does not answer the gateway",
}
_UNABLE_NOW = (4, 5, 6, 10, 11)
_SHOWN_BYTES = 8
_PARITY = {"even": "E", "odd": "O", "none": "N"}

# this module raises its errors as exceptions
logging.getLogger("pymodbus").setLevel(logging.CRITICAL)


class Received:
    """Buffer of the bytes received since the last request; used as a client's `trace_packet`."""

    def __init__(self) -> None:
        self.data = b""

    def __call__(self, sending: bool, data: bytes) -> bytes:
        """Store `data` if it was received, ignore it if it was sent; return it unchanged."""
        if not sending:
            self.data = data
        return data


class ModbusLink:
    """An open line to one or more drives; a context manager.

    Args:
        client: The connected client.
        name: Name of the line in errors.
        timeout_s: Longest wait for an answer [s].
        pause: Function that waits for a time [s].
        received: Buffer of the bytes received since the last request; the client's `trace_packet`.
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
        """Send one read request; return the contents of its registers.

        Raises:
            DeviceTimeoutError: The drive did not answer in time.
            ProtocolError: The drive refused the request, or the received bytes are not an answer to
                it.
            TransportError: The line is lost.
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
                    f"{self.name}, unit {unit}: the answer is for another request: {error}",
                    code="RID-MODBUS-GARBAGE",
                ) from error
            if garbage := self._received.data:
                shown = garbage[:_SHOWN_BYTES].hex(" ").upper()
                more = " …" if len(garbage) > _SHOWN_BYTES else ""
                raise ProtocolError(
                    f"{self.name}, unit {unit}: {len(garbage)} bytes came that are not a Modbus"
                    f" answer ({shown}{more}); compare baud rate, parity and stop bits with the"
                    " drive's, and check termination and other senders on the line",
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
            why = _EXCEPTIONS.get(code, "a manufacturer-specific code")
            unable = code in _UNABLE_NOW
            raise ProtocolError(
                f"{self.name}, unit {unit}: registers {read.address} to"
                f" {read.address + read.count - 1} are refused with exception {code}: {why};"
                f" {'check the drive and the gateway' if unable else 'correct the profile'}",
                code="RID-MODBUS-SILENT" if unable else "RID-MODBUS-PROFILE",
            )
        if response.function_code != _FUNCTION[read.table] or len(response.registers) != read.count:
            self._forget_late_answer()
            raise ProtocolError(
                f"{self.name}, unit {unit}: the answer has {len(response.registers)} registers of"
                f" function {response.function_code}, but {read.count} of function"
                f" {_FUNCTION[read.table]} were requested",
                code="RID-MODBUS-GARBAGE",
            )
        return list(response.registers)

    def close(self) -> None:
        """Close the line."""
        self._client.close()  # type: ignore[no-untyped-call]

    def _forget_late_answer(self) -> None:
        """Ensure that a late answer is not mistaken for the answer to the next request.

        A network connection is closed, which discards pending data. On a serial line, wait until a
        late answer has arrived; the client discards it before the next request.
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
        TransportError: The line cannot be opened, or its certificates cannot be used.
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
            " the drives are on and that no other program uses the line",
            code="RID-MODBUS-OPEN",
        )
    return ModbusLink(client, name, config.timeout_s, pause, received)


def _reason(link: ModbusTcp | ModbusRtu, timeout_s: float) -> str:
    """Return the reason why a line cannot be opened, which pymodbus only logs."""
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
    except (OSError, ValueError, termios.error) as error:  # a SerialException is an OSError
        return str(error)
    return "the first attempt failed, but a second one succeeded: try again"


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
    """TLS client that also checks the name in the drive's certificate."""

    def __init__(self, link: ModbusTcp, tls: ModbusTls, timeout_s: float) -> None:
        self._context = _tls_context(tls)
        self._server_name = tls.server_name or link.host
        super().__init__(
            link.host, sslctx=self._context, port=link.port, timeout=timeout_s, retries=0
        )

    def connect(self) -> bool:
        """Connect; raise OSError (such as SSLError) if that fails."""
        if self.socket is None:
            address = (self.comm_params.host, self.comm_params.port)
            timeout_s = self.comm_params.timeout_connect
            with contextlib.ExitStack() as undo:
                plain = undo.enter_context(socket.create_connection(address, timeout_s))
                self.socket = self._context.wrap_socket(plain, server_hostname=self._server_name)
                undo.pop_all()
        return True


def _tls_context(tls: ModbusTls) -> ssl.SSLContext:
    """Return the TLS context: it verifies drives, and has our certificate if one is configured."""
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
