"""`MonitorConfig`: connection that reads the drives' parameters and temperatures during motion."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from config.model import ConfigModel
from config.robot.robot import Temperature


class ModbusTls(ConfigModel):
    """Modbus/TCP Security: both sides present certificates (Modbus/TCP Security v3.6, 3.1).

    Paths are relative to the folder in which the program runs. `server_name` is the expected name
    in the drive's certificate; by default it is the host.
    """

    ca_file: str = Field(min_length=1)
    certificate_file: str | None = None
    key_file: str | None = None
    server_name: str | None = None

    @model_validator(mode="after")
    def _pair(self) -> ModbusTls:
        if (self.certificate_file is None) != (self.key_file is None):
            raise ValueError("certificate_file and key_file belong together; give both or neither")
        return self


class ModbusTcp(ConfigModel):
    """Drives, or a gateway to them, on a network; the usual port is 502, with TLS 802."""

    kind: Literal["tcp"]
    host: str = Field(min_length=1, max_length=253)
    port: Annotated[int, Field(ge=0, le=0xFFFF)] = 502
    tls: ModbusTls | None = None


class ModbusRtu(ConfigModel):
    """Drives on a serial line (RS-485); `address` is a device's path."""

    kind: Literal["rtu"]
    address: str = Field(min_length=1, max_length=256)
    baud_rate: Annotated[int, Field(ge=300, le=1_000_000)] = 19200
    parity: Literal["even", "odd", "none"] = "even"
    stop_bits: Literal[1, 2] = 1


class MonitorConfig(ConfigModel):
    """The drives that are polled, the quantities and the period.

    `units` are the Modbus addresses of the drives, one per axis, in the order of `axes`. `profile`
    names a bundled file or gives a path relative to the cell file. A request that is not answered
    within `timeout_s` is abandoned; a later answer is discarded.
    """

    link: Annotated[ModbusTcp | ModbusRtu, Field(discriminator="kind")]
    units: tuple[Annotated[int, Field(ge=0, le=247)], ...]
    profile: str = "servo_registers"
    period_s: Annotated[float, Field(ge=0.05, le=3600.0)] = 1.0
    timeout_s: Annotated[float, Field(ge=0.01, le=10.0)] = 0.3
    warmest_k: Temperature = 393.15

    @model_validator(mode="after")
    def _units_differ(self) -> MonitorConfig:
        if len(set(self.units)) != len(self.units):
            raise ValueError("units names an address twice; give each drive its own")
        return self
