"""`search`: the search for an optimal excitation, with progress, budget and interruption."""

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
from identification.design.easier import easier_problems
from identification.design.problem import ExcitationProblem
from identification.design.search import Candidate, candidates
from rid_daq.operations.experiment.design import Excitation
from rid_daq.operations.operation import Context
from rid_daq.terminal.exit_codes import ExitCode, exit_code_of_stop

SEEDS_APART: Final = 10_000
EASIER_STARTS: Final = 4
ROOM: Final = 0.5
"""Share of its amplitudes that the best motion must have kept, so that nothing easier is tried."""


@dataclass(frozen=True)
class SearchTrial:
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
    trials: tuple[SearchTrial, ...]
    interrupted_by: signal.Signals | None

    @property
    def curve(self) -> tuple[SearchTrial, ...]:
        """The trials that were the best so far when they were ready."""
        best: list[SearchTrial] = []
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


def search(
    problem: ExcitationProblem,
    cell: CellConfig,
    options: Excitation,
    context: Context,
    scheduler: str | None = None,
) -> Search:
    """Refine start after start, and keep the best that breaks no limit.

    Where none keeps half its size within the limits, fewer harmonics and longer periods are tried
    with a few starts each, and that is said. The result belongs to seed and starts alone, however
    many processes take part; a budget ends the search early, so that then the machine's speed has a
    say. An interruption (Ctrl-C) ends it with the best so far.

    Raises:
        ConfigError: No motion of any start holds every limit, or there is no pose to start from.
    """
    work = _Work(cell, options, context, time.monotonic(), scheduler)
    work.refine(problem, options.starts)
    for words, easier in easier_problems(problem):
        if work.enough:
            break
        context.say(f"{work.complaint()} Trying {words}.")
        work.refine(easier, min(options.starts, EASIER_STARTS))
    best, trials, interrupted_by = work.best, work.trials, work.interrupted_by
    if best is None:
        if interrupted_by is not None:
            context.say("Interrupted before any motion was found; nothing was written.")
            raise SystemExit(exit_code_of_stop(StopCode.INTERRUPTED, interrupted_by))
        raise ConfigError(
            f"none of {len(trials)} starts gave a motion that holds every limit. {work.complaint()}"
            " Take more --starts, a longer --period, or look at the limits, bodies and workspace",
            code="RID-DESIGN-NONE",
        )
    return Search(problem.criterion, best, tuple(trials), interrupted_by)


class _Work:
    """A search under way: every trial so far, and the best.

    Args:
        cell, options, context: As for `search`.
        began_s: When it began [s], by the monotonic clock.
        scheduler: Address of a Dask scheduler to compute on.
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
    def enough(self) -> bool:
        """Whether nothing easier is to be tried."""
        roomy = self.best is not None and self.best.amplitude >= ROOM
        return roomy or self.interrupted_by is not None or self._time_is_over()

    def complaint(self) -> str:
        """Say why something easier is to be tried."""
        if self.best is not None:
            return f"Limits leave {100.0 * self.best.amplitude:.0f} % of the best motion's size."
        if not self.trials:
            return "There was no time for any."
        return f"No start holds every limit; the last one: {'; '.join(self.trials[-1].broken[:3])}."

    def refine(self, problem: ExcitationProblem, starts: int) -> None:
        """Refine some starts, until they, the time or the user's patience are over."""
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
            signals_handled(_leave_once()) as interruption,
            self._context.progress("Designing", float(starts), "starts") as shown,
            closing(stream),
            suppress(KeyboardInterrupt),
        ):
            shown.update(0.0, "no start is refined yet")
            for candidate in stream:
                self._take(candidate)
                ready += 1
                line = "none holds every limit yet"
                if self.best is not None:
                    line = f"best {problem.criterion.describe(self.best.check.objective)}"
                shown.update(float(ready), line)
                if self._time_is_over():
                    break
        self.interrupted_by = interruption.signal

    def _take(self, candidate: Candidate) -> None:
        elapsed_s, check = time.monotonic() - self._began_s, candidate.check
        self.trials.append(SearchTrial(elapsed_s, candidate.seed, check.objective, check.broken))
        if not check.broken and (self.best is None or _key(candidate) < _key(self.best)):
            self.best = candidate

    def _time_is_over(self) -> bool:
        budget_s = self._options.budget_s
        return budget_s is not None and time.monotonic() - self._began_s >= budget_s


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
