"""`PowerStage`: the CiA 402 part of a simulated drive: states, ramps, commands to the motor."""

from __future__ import annotations

import math
from dataclasses import dataclass

from drivers.servo.cia402 import (
    CYCLIC_SYNCHRONOUS_VELOCITY,
    FOLLOWS_COMMAND,
    MAKERS_OWN,
    PROFILE_VELOCITY,
    VOLTAGE_ENABLED,
    PowerState,
    after_controlword,
)
from mock_hw.drive.object_dictionary import Key, ObjectDictionary
from mock_hw.drive.objects import (
    ABORT_CONNECTION,
    DISABLE_OPERATION_OPTION,
    FAULT_REACTION_OPTION,
    INTERPOLATION_INDEX,
    INTERPOLATION_PERIOD,
    MODE,
    POSITION,
    PROFILE_ACCELERATION,
    PROFILE_DECELERATION,
    QUICK_STOP_DECELERATION,
    QUICK_STOP_OPTION,
    SHUTDOWN_OPTION,
    TARGET_OF,
    TARGET_VELOCITY,
)

_STIFFNESS = 20.0  # gain of the drive's own position loop [1/s]
_REMOTE = 0x0200
_STAY_IN_QUICK_STOP = (5, 6)
_WITHOUT_MOTOR_POWER = (PowerState.NOT_READY_TO_SWITCH_ON, PowerState.FAULT)


class DriveClock:
    """Clock of a drive, which can run too fast or too slow.

    If the rate changes, timers that are already running keep the old rate.

    Attributes:
        rate: Seconds on the drive's clock per true second.
    """

    def __init__(self) -> None:
        self.rate = 1.0

    def true_duration_s(self, duration_s: float) -> float:
        """Convert a duration on the drive's clock to the true duration [s]."""
        return duration_s / self.rate


@dataclass(frozen=True, slots=True)
class Ramp:
    """A velocity that is constant, except for a linear change between two times [s]."""

    start_s: float
    end_s: float
    start: float
    end: float

    def at(self, time_s: float) -> float:
        """Return the velocity at a time [s]."""
        if time_s >= self.end_s:
            return self.end
        if time_s <= self.start_s:
            return self.start
        fraction = (time_s - self.start_s) / (self.end_s - self.start_s)
        return self.start + fraction * (self.end - self.start)


class PowerStage:
    """Power stage: computes the motor's velocity command from controlwords, set-points and time.

    Velocities are in units of 60FFh. While the power is off, the holding brake is closed.

    Args:
        objects: The drive's objects; option codes and decelerations are read at the time of their
            use.
        clock: Clock by which the durations of ramps are measured; None for an exact clock.
        acceleration_unit: Value of one unit of 6083h to 6085h, in units of 60FFh per second.

    Attributes:
        state: CiA 402 state.
        supplied: True if the motor supply is on; while it is off, no command enables the drive.
        next_s: End of a stopping ramp after which the state changes, at which `advance` is due [s];
            infinity without one.
    """

    def __init__(
        self,
        objects: ObjectDictionary,
        clock: DriveClock | None = None,
        acceleration_unit: float = 1.0,
    ) -> None:
        self._objects = objects
        self._acceleration_unit = acceleration_unit
        self._clock = clock or DriveClock()
        self.state = PowerState.NOT_READY_TO_SWITCH_ON
        self.supplied = True
        self.next_s = math.inf
        self._after_ramp: PowerState | None = None
        self._followed: int | None = None  # last position set-point
        self._ramp = Ramp(0.0, 0.0, 0.0, 0.0)
        self._controlword = 0

    @property
    def powered(self) -> bool:
        """True if the velocity loop runs; the brake is then open, otherwise closed."""
        return self.state.powered

    @property
    def following(self) -> bool:
        """True if the drive accepts set-points: it is enabled and not stopping."""
        return self.state is PowerState.OPERATION_ENABLED and self._after_ramp is None

    def statusword(self) -> int:
        """Return 6041h; of its warning and mode-specific bits, only bit 12 can be set."""
        follows = FOLLOWS_COMMAND if self.following else 0
        voltage = VOLTAGE_ENABLED if self.supplied else 0
        return self.state | voltage | _REMOTE | follows

    def velocity_at(self, time_s: float) -> float:
        """Return the velocity command of the loop at a time [s]."""
        return self._ramp.at(time_s)

    def set_target(self, velocity: float, now_s: float, over_s: float) -> None:
        """Change the velocity command linearly within `over_s`, if the drive accepts set-points."""
        if self.following:
            end_s = now_s + self._clock.true_duration_s(over_s)
            self._ramp = Ramp(now_s, end_s, self._ramp.at(now_s), velocity)

    def take_target(self, now_s: float) -> None:
        """Apply the set-point, by its mode: within the interpolation period, or on a ramp."""
        objects, mode = self._objects, self._objects[MODE]
        target = objects[TARGET_OF.get(mode, TARGET_VELOCITY)]
        period_s = objects[INTERPOLATION_PERIOD] * 10.0 ** objects[INTERPOLATION_INDEX]
        if mode == CYCLIC_SYNCHRONOUS_VELOCITY:
            self.set_target(target, now_s, period_s)
        elif mode in TARGET_OF:
            before = target if self._followed is None else self._followed
            self._followed = target
            velocity = (target - before) / period_s + _STIFFNESS * (before - objects[POSITION])
            self.set_target(velocity, now_s, period_s)
        elif mode in (PROFILE_VELOCITY, MAKERS_OWN):
            change = target - self._ramp.at(now_s)
            self.set_target(target, now_s, self._ramp_s(change, PROFILE_ACCELERATION))

    def _ramp_s(self, change: float, acceleration: Key) -> float:
        """Return the duration [s] of a velocity change; `acceleration` is the object to use."""
        return abs(change) / (max(1, self._objects[acceleration]) * self._acceleration_unit)

    def boot(self) -> None:
        """Enter Switch On Disabled, which accepts commands (T1); a drive in Fault stays there."""
        if self.state is not PowerState.FAULT:
            self.state = PowerState.SWITCH_ON_DISABLED
        self._controlword = 0

    def enter_state(self, state: PowerState = PowerState.SWITCH_ON_DISABLED) -> None:
        """Enter a state at once, at any speed and without a ramp; the velocity command becomes 0.

        The brake closes unless the motor has power in the new state.
        """
        self.state = state
        self._after_ramp = None
        self._followed = None
        self.next_s = math.inf
        self._ramp = Ramp(0.0, 0.0, 0.0, 0.0)

    def supply(self, supplied: bool) -> None:
        """Switch the motor supply off, as an emergency stop does, or on."""
        if not supplied and self.state not in _WITHOUT_MOTOR_POWER:
            self.enter_state()
        self.supplied = supplied

    def command(self, controlword: int, now_s: float) -> None:
        """Process a controlword (6040h)."""
        state, previous = self.state, self._controlword
        self._controlword = controlword
        if not self.supplied and state is PowerState.SWITCH_ON_DISABLED:
            return
        wanted = after_controlword(state, controlword, previous)
        if state is PowerState.OPERATION_ENABLED:
            self._leave_operation(wanted, now_s)
        elif state is PowerState.QUICK_STOP_ACTIVE:
            self._leave_quick_stop(wanted)
        elif wanted is not state:
            self.enter_state(wanted)

    def quick_stop(self, now_s: float) -> None:
        """Stop according to 605Ah (T11); no effect if the drive is not enabled."""
        if self.state is not PowerState.OPERATION_ENABLED:
            return
        option = self._objects[QUICK_STOP_OPTION]
        if option == 0:
            self.enter_state()
            return
        self.state = PowerState.QUICK_STOP_ACTIVE
        after = None if option in _STAY_IN_QUICK_STOP else PowerState.SWITCH_ON_DISABLED
        fast = option in (2, 6)
        self._stop(QUICK_STOP_DECELERATION if fast else PROFILE_DECELERATION, now_s, after)

    def fault(self, now_s: float) -> None:
        """React to a fault according to 605Eh (T13), then enter Fault (T14)."""
        if self.state in (PowerState.FAULT, PowerState.FAULT_REACTION_ACTIVE):
            return
        option = self._objects[FAULT_REACTION_OPTION]
        if not self.powered or option == 0:
            self.enter_state(PowerState.FAULT)
            return
        self.state = PowerState.FAULT_REACTION_ACTIVE
        fast = option == 2
        deceleration = QUICK_STOP_DECELERATION if fast else PROFILE_DECELERATION
        self._stop(deceleration, now_s, PowerState.FAULT)

    def abort_connection(self, now_s: float) -> None:
        """React to the loss of the master according to 6007h; no effect without power."""
        if not self.powered:
            return
        reaction = self._objects[ABORT_CONNECTION]
        if reaction == 1:
            self.fault(now_s)
        elif reaction == 2:
            self.enter_state()
        elif reaction == 3:
            self.quick_stop(now_s)

    def advance(self, until_s: float) -> None:
        """Enter the state after the stopping ramp, if the ramp has ended by `until_s` [s]."""
        if self._after_ramp is not None and until_s >= self.next_s:
            self.enter_state(self._after_ramp)

    def _leave_operation(self, wanted: PowerState, now_s: float) -> None:
        if wanted is PowerState.OPERATION_ENABLED:
            if self._after_ramp is not None:
                self._after_ramp = None
                self.next_s = math.inf
        elif wanted is PowerState.QUICK_STOP_ACTIVE:
            self.quick_stop(now_s)
        elif wanted is PowerState.SWITCH_ON_DISABLED:
            self.enter_state()
        else:
            down = wanted is PowerState.READY_TO_SWITCH_ON
            option = SHUTDOWN_OPTION if down else DISABLE_OPERATION_OPTION
            if self._objects[option] == 0:
                self.enter_state(wanted)
            elif self._after_ramp is not wanted:
                self._stop(PROFILE_DECELERATION, now_s, wanted)

    def _leave_quick_stop(self, wanted: PowerState) -> None:
        """Leave the quick stop; only with 5 or 6 in 605Ah can the drive be enabled again (T16)."""
        if wanted is PowerState.SWITCH_ON_DISABLED:
            self.enter_state()
        elif wanted is PowerState.OPERATION_ENABLED and self._after_ramp is None:
            self.state = PowerState.OPERATION_ENABLED

    def _stop(self, deceleration: Key, now_s: float, after: PowerState | None) -> None:
        velocity = self._ramp.at(now_s)
        end_s = now_s + self._clock.true_duration_s(self._ramp_s(velocity, deceleration))
        self._ramp = Ramp(now_s, end_s, velocity, 0.0)
        self._after_ramp = after
        self.next_s = math.inf if after is None else end_s
