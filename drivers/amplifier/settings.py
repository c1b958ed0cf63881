"""The amplifier's settings that a cell file requires."""

from __future__ import annotations

import math
from dataclasses import dataclass

from config.cell.plate import CHANNEL_NAMES, AmplifierConfig

_SAME = 1e-3


@dataclass(frozen=True, slots=True)
class RequiredSetting:
    """One required setting.

    Attributes:
        name: Field of `config.cell.amplifier_profile.Commands`.
        channel: 1 to 8, 0 for all.
        label: The setting's name, in words.
        is_settable: True if the program can change the setting; if False, the cell file must state
            the amplifier's own value.
    """

    name: str
    channel: int
    value: float
    label: str
    unit: str
    is_settable: bool = True

    @property
    def text(self) -> str:
        """The required value, in the form in which it is sent."""
        return f"{self.value:.7g}"

    def shown(self, text: str) -> str:
        """Return a value with its unit."""
        return f"{text} {self.unit}".rstrip()

    def agrees(self, text: str) -> bool:
        """Return True if the amplifier's answer is within 0.1 % of the required value."""
        try:
            found = float(text)
        except ValueError:
            return False
        return math.isclose(found, self.value, rel_tol=_SAME)


def required_settings(config: AmplifierConfig) -> tuple[RequiredSetting, ...]:
    """Return all settings that a cell file requires, in the order in which they are set."""
    channels = range(1, len(CHANNEL_NAMES) + 1)
    sensitivities = zip(channels, CHANNEL_NAMES, config.sensitivity_pc_n, strict=True)
    ranges = zip(channels, CHANNEL_NAMES, config.range_n, strict=True)
    return (
        RequiredSetting(
            "bits", 0, config.bits, "resolution of the converter [bits]", "", is_settable=False
        ),
        *(
            RequiredSetting("sensitivity", channel, value, f"sensitivity of {name}", "pC/N")
            for channel, name, value in sensitivities
        ),
        *(
            RequiredSetting("range", channel, value, f"range of {name}", "N")
            for channel, name, value in ranges
        ),
        RequiredSetting("low_pass", 0, config.low_pass_hz, "low-pass", "Hz"),
        RequiredSetting("rate", 0, config.rate_hz, "rows per second", "1/s"),
        RequiredSetting("format", 0, int(config.format == "binary"), "format (1 is binary)", ""),
        RequiredSetting("trigger", 0, int(config.trigger), "events at trigger edges (1 is on)", ""),
    )
