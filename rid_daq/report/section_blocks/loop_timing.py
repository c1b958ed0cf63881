"""`timing_blocks`: the timing of the cyclic tasks of a result's runs."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from rid_daq.blocks.block import AnyBlock, Heading, Text
from rid_daq.blocks.plot import Axis, Bar, Panel, Plot
from rid_daq.report.sections.timing import LoopTiming, Timing, bin_names

LEAST: Final = 0.5  # lower end of a logarithmic axis of counts


def timing_blocks(section: Timing) -> Iterator[AnyBlock]:
    """Yield the timing of each run, and histograms of the lateness of its cycles."""
    if section.loops:
        yield Heading(text="Loop timing")
    for timing in section.loops or ():
        yield Text(text=f"{timing.role}: {timing.sentence}")
        if timing.has_lateness:
            yield lateness_plot(timing)


def lateness_plot(timing: LoopTiming) -> Plot:
    """Return a histogram of the lateness of a run's cycles."""
    names = bin_names(timing.edges_us)
    panel = Panel(
        x=Axis("lateness of the cycle", "µs"),
        y=Axis("cycles", log=any(timing.counts), least=LEAST, most=4.0 * max(1.0, *timing.counts)),
        bars=tuple(
            Bar(name, float(count)) for name, count in zip(names, timing.counts, strict=True)
        ),
    )
    return Plot(name="lateness", panels=(panel,))
