"""`PayloadSessionRequest`: what a payload session is asked for, and what it was begun with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Final

from pydantic import TypeAdapter, ValidationError

from config.errors import ConfigError
from config.ranges import Pace, Periods, Ranged, Repeats, Seed, WarmUpPeriods
from identification.choices import PayloadLimits, RehearsalPercent, UntilMassKg, WarmUpPercent
from identification.payload.known import Known
from rid_daq.live.live_page import LiveOptions
from rid_daq.preflight.axis_test import AxisTestRule
from rid_daq.recording.payload_state import LOADED, UNLOADED

_OF_SESSION: Final = frozenset(
    {
        "repeats",
        "model",
        "payload",
        "known",
        "until_mass_kg",
        "rehearsal_percent",
        "warm_up_percent",
        "warm_up_periods",
        "limits",
        "label",
        "seed",
    }
)
"""What a session that is gone on with keeps; its motion stands in its folder."""


@dataclass(frozen=True)
class PayloadSessionRequest(Ranged):
    """What `rid-daq payload CELL` was asked for.

    Attributes
    ----------
    cell : str
        A bundled name or a cell file.
    runs : Path
        The folder of the run folders.
    motion : Path or None
        A periodic motion; one is searched if None.
    periods, repeats : int
        Periods of each run at most, and runs with the payload.
    model : Path or None
        The unloaded robot, in place of the unloaded run.
    payload : str or None
        What is hung on a simulated robot.
    known : tuple of Known
        What is known otherwise.
    until_mass_kg : float or None
        2 sigma of the mass that ends a loaded run.
    rehearsal_percent : float
        Speed of the rehearsal; 0 skips it.
    warm_up_percent, warm_up_periods : float, int
        Change of friction in a period that is warm, and periods at most; 0 percent skip it.
    limits : PayloadLimits
        How sure the payload must be.
    label : str
        What to call the session and its runs.
    resume : str or None
        The session that is gone on with.
    yes : bool
        Whether every question is answered with yes.
    practise : bool
        Whether a simulated cell is asked about like a real one.
    seed : int
        Of the motion and a simulated cell.
    axis_test : AxisTestRule
        Whether a real cell's axes must have been tested.
    pace : float or None
        How many times the clock's pace a simulated cell keeps; as fast as it can if None.
    live : LiveOptions
        Whether and where it is shown.
    given : tuple of str
        Which of these, and of the `limits` by themselves, a person has said, be they the usual
        ones: of a session that is gone on with they replace what it was begun with.
    """

    cell: str
    runs: Path
    motion: Path | None = None
    periods: Periods = 18
    repeats: Repeats = 1
    model: Path | None = None
    payload: str | None = None
    known: tuple[Known, ...] = ()
    until_mass_kg: UntilMassKg | None = None
    rehearsal_percent: RehearsalPercent = 25.0
    warm_up_percent: WarmUpPercent = 1.0
    warm_up_periods: WarmUpPeriods = 30
    limits: PayloadLimits = field(default_factory=PayloadLimits)
    label: str = "payload"
    resume: str | None = None
    yes: bool = False
    seed: Seed = 0
    axis_test: AxisTestRule = AxisTestRule.REQUIRED
    pace: Pace | None = None
    live: LiveOptions = field(default_factory=LiveOptions)
    practise: bool = False
    given: tuple[str, ...] = ()

    @property
    def asked(self) -> dict[str, object]:
        """What belongs to the session and is not the usual, as JSON has it."""
        return self._of_session(exclude_defaults=True)

    @property
    def choices(self) -> dict[str, object]:
        """All that belongs to the session, as JSON has it."""
        return self._of_session(exclude_defaults=False)

    def _of_session(self, *, exclude_defaults: bool) -> dict[str, object]:
        whole = self if self.model is None else replace(self, model=self.model.absolute())
        told = TypeAdapter(PayloadSessionRequest).dump_python(
            whole, mode="json", exclude_defaults=exclude_defaults
        )
        return {name: value for name, value in told.items() if name in _OF_SESSION}

    def as_begun(self, asked: Mapping[str, Any]) -> PayloadSessionRequest:
        """Return the request of a session begun with `asked`; what is said now counts more.

        Raises
        ------
        ConfigError
            `asked` cannot be asked for.
        """
        known = {name: value for name, value in asked.items() if name in _OF_SESSION}
        begun = {"cell": self.cell, "runs": self.runs, **known}
        try:
            old = TypeAdapter(PayloadSessionRequest).validate_python(begun)
        except ValidationError as error:
            first = error.errors()[0]
            where = ".".join(map(str, first["loc"]))
            raise ConfigError(
                f"--resume {self.resume}: its file says {where}: {first['msg']}; was it edited?",
                code="RID-SESSION-STATE",
            ) from None
        said = {*self.given, *self.asked} - {"limits"}
        taken = {name: getattr(old, name) for name in known if name not in said}
        if "limits" in known:
            now, usual = asdict(self.limits), asdict(PayloadLimits())
            given = set(now if "limits" in self.given else self.given)
            new = {
                name: value for name, value in now.items() if name in given or value != usual[name]
            }
            taken["limits"] = replace(old.limits, **new)
        return replace(self, **taken)

    @property
    def wanted(self) -> tuple[str, ...]:
        """The steps that the payload is estimated from."""
        loaded = tuple(f"{LOADED} {i + 1}" for i in range(self.repeats))
        return (UNLOADED, *loaded) if self.model is None else loaded
