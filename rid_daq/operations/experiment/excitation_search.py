"""`search`: search for an optimal excitation, with progress, time budget and interruption."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable
from contextlib import closing, suppress
from dataclasses import dataclass
from typing import Final

from acquisition.supervision.stop_reason import StopCode
from config.cell.cell import CellConfig
from config.errors import ConfigError
from config.process.termination import signals_handled
from identification.design.criteria import Criterion
from identification.design.easier_problems import easier_problems
from identification.design.problem import ExcitationProblem
from identification.design.search import Candidate, candidates
from rid_daq.operations.experiment.design import Excitation
from rid_daq.operations.operation import Context
from rid_daq.terminal.exit_codes import ExitCode, exit_code_of_stop

SEEDS_APART: Final = 10_000
EASIER_STARTS: Final = 4
ROOM: Final = 0.5
"""If the limits allow less than this fraction of the best motion's amplitudes, an easier problem is
tried.
"""


@dataclass(frozen=True)
class SearchTrial:
    """Result of one start of a search; `elapsed_s` is the time since the search began."""

    elapsed_s: float
    seed: int
    objective: float
    broken: tuple[str, ...]


@dataclass(frozen=True)
class Search:
    """Result of a search: the best motion that keeps all limits, and all trials in time order."""

    criterion: Criterion
    best: Candidate
    trials: tuple[SearchTrial, ...]
    interrupted_by: signal.Signals | None

    @property
    def curve(self) -> tuple[SearchTrial, ...]:
        """Trials that were the best so far when they ended."""
        best: list[SearchTrial] = []
        for trial in self.trials:
            if not trial.broken and (not best or trial.objective < best[-1].objective):
                best.append(trial)
        return tuple(best)

    @property
    def exit_code(self) -> ExitCode:
        """Exit code of the program; it shows if a signal interrupted the search."""
        if self.interrupted_by is None:
            return ExitCode.DONE
        return exit_code_of_stop(StopCode.INTERRUPTED, self.interrupted_by)


def search(
    problem: ExcitationProblem,
    cell: CellConfig,
    options: Excitation,
    context: Context,
    scheduler: str | None = None,
) -> Search:
    """Refine random starts, and return the best motion that keeps all limits.

    If no motion keeps half its amplitude within the limits, problems with fewer harmonics and
    longer periods are tried with a few starts each; a message says so. The result depends on seed
    and number of starts only, not on the number of processes. A time budget ends the search early;
    the result then also depends on the computer's speed. An interruption (Ctrl-C) ends the search
    with the best motion so far.

    Raises:
        ConfigError: No motion of any start keeps all limits, or there is no pose to start from.
        SystemExit: The search was interrupted before a motion was found.
    """
    work = _SearchState(cell, options, context, time.monotonic(), scheduler)
    work.refine(problem, options.starts)
    for words, easier in easier_problems(problem):
        if work.is_done:
            break
        context.say(f"{work.reason_for_easier()} Trying {words}.")
        work.refine(easier, min(options.starts, EASIER_STARTS))
    best, trials, interrupted_by = work.best, work.trials, work.interrupted_by
    if best is None:
        if interrupted_by is not None:
            context.say("Interrupted before any motion was found; nothing was written.")
            raise SystemExit(exit_code_of_stop(StopCode.INTERRUPTED, interrupted_by))
        raise ConfigError(
            f"none of {len(trials)} starts gave a motion that keeps all limits."
            f" {work.reason_for_easier()} Use more --starts or a longer --period, or check the"
            " limits, bodies and workspace in the files",
            code="RID-DESIGN-NONE",
        )
    return Search(problem.criterion, best, tuple(trials), interrupted_by)


class _SearchState:
    """State of a running search: all trials so far, and the best motion so far.

    Args:
        cell, options, context: As for `search`.
        began_s: Start of the search [s], by the monotonic clock.
        scheduler: Address of a Dask scheduler that performs the search; None for this computer.
    """

    def __init__(
        self,
        cell: CellConfig,
        options: Excitation,
        context: Context,
        began_s: float,
        scheduler: str | None,
    ) -> None:
        self._cell = cell
        self._options = options
        self._context = context
        self._began_s = began_s
        self._scheduler = scheduler
        self.trials: list[SearchTrial] = []
        self.best: Candidate | None = None
        self.interrupted_by: signal.Signals | None = None

    @property
    def is_done(self) -> bool:
        """True if no easier problem is to be tried: enough room, an interruption, or no time."""
        roomy = self.best is not None and self.best.amplitude >= ROOM
        return roomy or self.interrupted_by is not None or self._time_is_over()

    def reason_for_easier(self) -> str:
        """Return the reason for trying an easier problem, as a sentence."""
        if self.best is not None:
            return (
                f"The limits allow only {100.0 * self.best.amplitude:.0f} % of the best"
                " motion's amplitude."
            )
        if not self.trials:
            return "The time budget ended before any start was refined."
        return (
            "No start gives a motion that keeps all limits. Limits that the last start exceeds:"
            f" {'; '.join(self.trials[-1].broken[:3])}."
        )

    def refine(self, problem: ExcitationProblem, starts: int) -> None:
        """Refine starts until all are refined, the time is over, or the user interrupts."""
        options, first = self._options, SEEDS_APART * self._options.seed
        stream = candidates(
            problem,
            range(first, first + starts),
            self._cell.cycle_time_s,
            periods=options.periods,
            scheduler=self._scheduler,
        )
        ready = 0
        with (
            signals_handled(_interrupt_once()) as interruption,
            self._context.progress("Designing", float(starts), "starts") as shown,
            closing(stream),
            suppress(KeyboardInterrupt),
        ):
            shown.update(0.0, "no start refined yet")
            for candidate in stream:
                self._add_trial(candidate)
                ready += 1
                line = "no motion keeps all limits yet"
                if self.best is not None:
                    line = f"best {problem.criterion.describe(self.best.check.objective)}"
                shown.update(float(ready), line)
                if self._time_is_over():
                    break
        self.interrupted_by = interruption.signal

    def _add_trial(self, candidate: Candidate) -> None:
        elapsed_s, check = time.monotonic() - self._began_s, candidate.check
        self.trials.append(SearchTrial(elapsed_s, candidate.seed, check.objective, check.broken))
        if not check.broken and (self.best is None or _sort_key(candidate) < _sort_key(self.best)):
            self.best = candidate

    def _time_is_over(self) -> bool:
        budget_s = self._options.budget_s
        return budget_s is not None and time.monotonic() - self._began_s >= budget_s


def _interrupt_once() -> Callable[[], None]:
    """Return a signal handler that interrupts the search at its first call only."""
    interrupted = False

    def interrupt() -> None:
        nonlocal interrupted
        if not interrupted:
            interrupted = True
            raise KeyboardInterrupt

    return interrupt


def _sort_key(candidate: Candidate) -> tuple[float, int]:
    """Return a sort key that makes the result independent of the order of arrival."""
    return (candidate.check.objective, candidate.seed)
