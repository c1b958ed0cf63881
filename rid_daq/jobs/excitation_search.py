"""The search for an optimal excitation as a command runs it: progress, budget, interruption."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable
from contextlib import closing, suppress
from dataclasses import dataclass
from typing import Final, Literal

import typer

from acquisition.supervision.stop_reason import StopCode
from config.cell.cell import CellConfig
from config.errors import ConfigError
from config.process.termination import signals_handled
from identification.design.criteria import Criterion
from identification.design.problem import ExcitationProblem
from identification.design.search import Candidate, candidates
from rid_daq.terminal.console import Console
from rid_daq.terminal.exit_codes import ExitCode, exit_code_of_stop

SEEDS_APART: Final = 10_000


@dataclass(frozen=True)
class SearchOptions:
    """What an optimal excitation is searched with.

    Attributes
    ----------
    period_s : float
        The period [s], a whole number of the cell's cycles.
    periods : int
        Periods that count.
    harmonics : int
        The highest harmonic used.
    criterion : "condition" or "d-optimal"
        What is optimal, where nothing is wanted in particular.
    wanted : tuple of str
        Base parameters that are to be known best, or `torque`.
    starts, seed : int
        How many starts are refined, and the seed they come from.
    budget_s : float or None
        The search ends after the start that is ready after this time [s].
    scheduler : str or None
        Address of a Dask scheduler to compute on.
    """

    period_s: float
    periods: int = 16
    harmonics: int = 5
    criterion: Literal["condition", "d-optimal"] = "d-optimal"
    wanted: tuple[str, ...] = ()
    starts: int = 12
    seed: int = 0
    budget_s: float | None = None
    scheduler: str | None = None


@dataclass(frozen=True)
class Trial:
    """One start of a search: when it was ready, and what came of it."""

    elapsed_s: float
    seed: int
    objective: float
    broken: tuple[str, ...]


@dataclass(frozen=True)
class Search:
    """A finished search: the best motion that breaks nothing, and every trial in time."""

    criterion: Criterion
    best: Candidate
    trials: tuple[Trial, ...]
    interrupted_by: signal.Signals | None

    @property
    def curve(self) -> tuple[Trial, ...]:
        """The trials that were the best so far when they were ready."""
        best: list[Trial] = []
        for trial in self.trials:
            if not trial.broken and (not best or trial.objective < best[-1].objective):
                best.append(trial)
        return tuple(best)

    @property
    def exit_code(self) -> ExitCode:
        """What a script is told: also that the search was interrupted."""
        if self.interrupted_by is None:
            return ExitCode.DONE
        return exit_code_of_stop(StopCode.INTERRUPTED, self.interrupted_by)

    def print(self, console: Console, cell: CellConfig) -> None:
        """Print how the search went, and what the motion's torques and distances are."""
        curve = "; ".join(
            f"{self.criterion.describe(trial.objective)} after {trial.elapsed_s:.1f} s"
            for trial in self.curve
        )
        broken = sum(bool(trial.broken) for trial in self.trials)
        console.say(
            f"{len(self.trials)} starts, {broken} of them in vain. The best so far: {curve}."
        )
        uses = self.best.check.uses
        torques = [use for use in uses if use.what.startswith("torque")]
        shares = ", ".join(f"{100.0 * use.used / use.limit:.0f}" for use in torques)
        console.say(
            f"Largest torque expected, axis by axis: {shares} % of the limit."
            if torques
            else "Torque is not checked: the robot file has no `cad`, and no --model is given."
        )
        limits = None if cell.plate is None else cell.plate.limits
        if limits is not None:
            base = [use for use in uses if use.what.endswith("on the base")]
            shares = ", ".join(f"{100.0 * use.used / use.limit:.0f}" for use in base)
            console.say(
                f"Largest reaction on the base expected, Fx to Mz: {shares} % of the limit."
                if base
                else "The reaction on the base is not checked: give a combined model by --model."
            )
        nearest = min(
            (use for use in uses if use.unit == "m" and use.what.startswith("distance")),
            key=lambda use: use.used,
            default=None,
        )
        console.say(
            f"Nearest approach: {1000.0 * nearest.used:.0f} mm, {nearest.what}."
            if nearest is not None
            else "Collisions are not checked: neither `bodies` nor a `workspace` is stated."
        )
        active = [use.what for use in uses if use.active]
        console.say(f"What holds the motion back: {', '.join(active) or 'nothing'}.")


def search(
    problem: ExcitationProblem, cell: CellConfig, options: SearchOptions, console: Console
) -> Search:
    """Refine start after start, and keep the best that breaks no limit.

    The result belongs to seed and starts alone, however many processes take part; a budget ends
    the search early, so that then the machine's speed has a say. An interruption (Ctrl-C) ends it
    with the best so far.

    Raises
    ------
    ConfigError
        No motion of any start holds every limit.
    """
    began_s = time.monotonic()
    trials: list[Trial] = []
    best: Candidate | None = None
    first, budget_s = SEEDS_APART * options.seed, options.budget_s
    stream = candidates(
        problem,
        range(first, first + options.starts),
        cell.cycle_time_s,
        periods=options.periods,
        scheduler=options.scheduler,
    )
    with (
        signals_handled(_leave_once()) as interruption,
        console.progress("Designing", float(options.starts), "starts") as shown,
        closing(stream),
        suppress(KeyboardInterrupt),
    ):
        for candidate in stream:
            elapsed_s = time.monotonic() - began_s
            check = candidate.check
            trials.append(Trial(elapsed_s, candidate.seed, check.objective, check.broken))
            if not check.broken and (best is None or _key(candidate) < _key(best)):
                best = candidate
            line = "none holds every limit yet"
            if best is not None:
                line = f"best {problem.criterion.describe(best.check.objective)}"
            shown.update(float(len(trials)), line)
            if budget_s is not None and elapsed_s >= budget_s:
                break
    if best is None:
        if interruption.signal is not None:
            console.say("Interrupted before any motion was found; nothing was written.")
            raise typer.Exit(exit_code_of_stop(StopCode.INTERRUPTED, interruption.signal))
        reasons = trials[-1].broken[:3] if trials else ("there was no time for any",)
        raise ConfigError(
            f"none of {len(trials)} starts gave a motion that holds every limit; the last one:"
            f" {'; '.join(reasons)}. Take more --starts, a longer --period, or look at the limits,"
            " bodies and workspace"
        )
    return Search(problem.criterion, best, tuple(trials), interruption.signal)


def _leave_once() -> Callable[[], None]:
    """Return what interrupts the search at its first call, and lets it clean up at others."""
    left = False

    def leave() -> None:
        nonlocal left
        if not left:
            left = True
            raise KeyboardInterrupt

    return leave


def _key(candidate: Candidate) -> tuple[float, int]:
    """Order candidates, so that the order in which they arrive does not matter."""
    return (candidate.check.objective, candidate.seed)
