"""`MonitorConfig`: connection that reads the drives' parameters and temperatures during motion."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from config.model import ConfigModel
from config.quantities import NoTruthValue, Temperature


class ModbusTls(ConfigModel):
    """Modbus/TCP Security (v3.6, 3.1): the drive presents a certificate.

    With `certificate_file` and `key_file`, this computer presents one too, as the standard
    requires.

    Paths are relative to the folder in which the program runs.

    Attributes:
        ca_file: Certificate of the authority that signed the drive's certificate.
        certificate_file: This computer's certificate.
        key_file: Key of this computer's certificate.
        server_name: Expected name in the drive's certificate; by default the host.
    """

    ca_file: str = Field(min_length=1)
    certificate_file: str | None = None
    key_file: str | None = None
    server_name: str | None = None

    @model_validator(mode="after")
    def _check_key_pair(self) -> ModbusTls:
        if (self.certificate_file is None) != (self.key_file is None):
            raise ValueError("certificate_file and key_file belong together; give both or neither")
        return self


class ModbusTcp(ConfigModel):
    """Drives, or a gateway to them, on a network.

    Attributes:
        kind: Kind of connection.
        host: Name or address.
        port: Usually 502; with TLS usually 802, which must be stated.
        tls: Certificates, for Modbus/TCP Security.
    """

    kind: Literal["tcp"]
    host: str = Field(min_length=1, max_length=253)
    port: Annotated[int, Field(ge=0, le=0xFFFF)] = 502
    tls: ModbusTls | None = None


class ModbusRtu(ConfigModel):
    """Drives on a serial line (RS-485).

    Attributes:
        kind: Kind of connection.
        address: Path of the serial port.
        baud_rate: Baud rate of the serial line, as set in the drives.
        parity: Parity bit of the serial line, as set in the drives.
        stop_bits: Number of stop bits of the serial line, as set in the drives.
    """

    kind: Literal["rtu"]
    address: str = Field(min_length=1, max_length=256)
    baud_rate: Annotated[int, Field(ge=300, le=1_000_000)] = 19200
    parity: Literal["even", "odd", "none"] = "even"
    stop_bits: Annotated[Literal[1, 2], NoTruthValue] = 1


class MonitorConfig(ConfigModel):
    """Polling of the drives over Modbus: connection, addresses, registers and period.

    Attributes:
        link: The connection.
        units: Modbus addresses of the drives, one per axis, in the order of `axes`.
        profile: Registers of the drives: a bundled name, or a path relative to the cell file.
        period_s: Time between two readings.
        timeout_s: A request that is not answered within this time is abandoned; a later answer is
            discarded.
        warmest_k: Highest temperature of a drive or motor at which the robot may move [K].
    """

    link: Annotated[ModbusTcp | ModbusRtu, Field(discriminator="kind")]
    units: tuple[Annotated[int, Field(ge=0, le=247)], ...]
    profile: str = "servo_registers"
    period_s: Annotated[float, Field(ge=0.05, le=3600.0)] = 1.0
    timeout_s: Annotated[float, Field(ge=0.01, le=10.0)] = 0.3
    warmest_k: Temperature = 393.15

    @model_validator(mode="after")
    def _check_units(self) -> MonitorConfig:
        if len(set(self.units)) != len(self.units):
            raise ValueError("units names an address twice; give each drive its own")
        return self
