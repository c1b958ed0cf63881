"""`DriveProfile`: Modbus registers of a drive: their quantity, type, word order and scale.

A profile is data, so that a drive of another maker only needs another file. Addresses are those on
the wire; they begin at 0. If a manual counts from 1, subtract 1; if it counts from 40001, subtract
40001.
"""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import Field, model_validator

from config.model import ConfigModel

RegisterType = Literal["uint16", "int16", "uint32", "int32", "float32"]
Quantity = Literal[
    "motor_temperature_k",
    "operating_time_s",
    "torque_constant_nm_per_a",
    "torque_constant_per_k",
    "reference_temperature_k",
    "rated_torque_nm",
    "rated_current_a",
    "rotor_inertia_kg_m2",
]

POLLED: Final[tuple[Quantity, ...]] = ("motor_temperature_k", "operating_time_s")
NAMEPLATE: Final[tuple[Quantity, ...]] = (
    "torque_constant_nm_per_a",
    "torque_constant_per_k",
    "reference_temperature_k",
    "rated_torque_nm",
    "rated_current_a",
    "rotor_inertia_kg_m2",
)
MOST_REGISTERS: Final = 125  # per read (Modbus application protocol 1.1b3, 6.3)


class Register(ConfigModel):
    """The register of a quantity; its SI value is `scale` times the number read plus `offset`.

    A temperature in tenths of a degree Celsius has the scale 0.1 and the offset 273.15.

    Attributes:
        address: Address of the first register, counted from 0.
        type: Type of the number; 32-bit types take two registers.
        table: Holding registers (function code 3) or input registers (4).
        scale: SI units per count.
        offset: Value at count 0, in SI units.
    """

    address: Annotated[int, Field(ge=0, le=0xFFFF)]
    type: RegisterType
    table: Literal["holding", "input"] = "holding"
    scale: float = 1.0
    offset: float = 0.0

    @model_validator(mode="after")
    def _check_scale(self) -> Register:
        if self.scale == 0.0:
            raise ValueError("scale must not be 0")
        if self.address + self.count > 0x10000:
            raise ValueError(
                f"a {self.type} does not fit at address {self.address}; correct address or type"
            )
        return self

    @property
    def count(self) -> int:
        """Number of registers of the quantity."""
        return 1 if self.type.endswith("16") else 2


class DriveProfile(ConfigModel):
    """The registers of one type of drive.

    Attributes:
        name: Name of the profile.
        word_order: Order of the registers of a 32-bit number: `big`, the usual one, has the more
            significant register first.
        largest_gap: Registers that are at most this number of addresses apart are read together.
        most_registers: Largest number of registers in one request.
        registers: The register of each quantity, by its name.
    """

    name: str = Field(pattern=r"^[A-Za-z0-9][\w.-]{0,63}$")
    word_order: Literal["big", "little"] = "big"
    largest_gap: Annotated[int, Field(ge=0, le=64)] = 8
    most_registers: Annotated[int, Field(ge=2, le=MOST_REGISTERS)] = MOST_REGISTERS
    registers: dict[Quantity, Register]

    @model_validator(mode="after")
    def _check_registers(self) -> DriveProfile:
        if "motor_temperature_k" not in self.registers:
            raise ValueError("registers lacks motor_temperature_k, which is polled; add it")
        names: dict[tuple[str, int], str] = {}
        for name, register in self.registers.items():
            for address in range(register.address, register.address + register.count):
                other = names.setdefault((register.table, address), name)
                if other != name:
                    raise ValueError(
                        f"{other} and {name} share the register {address}; correct one address"
                    )
        return self
