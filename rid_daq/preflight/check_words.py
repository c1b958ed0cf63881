"""`show_devices`, `all_blocks`: show the preflight to people, device by device, red lines first."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rid_daq.blocks.block import AnyBlock, Cells, Heading, Text, table
from rid_daq.preflight.check_line import CheckLine
from rid_daq.terminal.context import Context

_WORDS = {"red": "RED", "allowed": "allowed", "ok": "ok", "shown": "-"}


def show_devices(context: Context, lines: Sequence[CheckLine]) -> None:
    """Write the headline of each device, and below it the device's red and allowed lines.

    Args:
        context: Output for people.
        lines: All lines of some devices.
    """
    for where, own in _by_place(lines).items():
        context.say(f"{_WORDS[_worst_verdict(own)]:<8}{where}: {_summary(own)}")
        problems = [line for line in own if line.verdict in ("red", "allowed")]
        for line in sorted(problems, key=lambda each: each.verdict != "red"):
            context.say(
                f"  {_WORDS[line.verdict]:<8}{line.what}: {line.found}, required {line.required}"
            )
            if line.verdict == "red" and line.next_action:
                context.say(f"          {line.next_action}")


def all_blocks(lines: Sequence[CheckLine]) -> Iterator[AnyBlock]:
    """Yield all lines: first those that are equal for all drives, then each device's own lines.

    Red lines come first in each group.

    Args:
        lines: All lines of a preflight.
    """
    drives = list(dict.fromkeys(line.where for line in lines if line.of_drive))
    shared: list[CheckLine] = []
    for what in dict.fromkeys(line.what for line in lines if line.of_drive):
        same = [line for line in lines if line.what == what and line.of_drive]
        alike = {(line.found, line.required, line.verdict) for line in same}
        if len(same) == len(drives) > 1 and len(alike) == 1:
            shared.append(same[0])
    whats = {line.what for line in shared}
    own = [line for line in lines if not (line.of_drive and line.what in whats)]
    groups = {"every drive": shared, **_by_place(own)} if shared else _by_place(own)
    for where, found in groups.items():
        found = sorted(found, key=lambda line: line.verdict != "red")
        yield Heading(text=f"\n{where}", level=3)
        yield table(
            found,
            Cells("", lambda line: _WORDS[line.verdict]),
            Cells("what", lambda line: line.what),
            Cells("found", lambda line: line.found),
            Cells("required", lambda line: line.required),
            failed=lambda line: line.verdict == "red",
        )
        for line in found:
            if line.verdict == "red" and line.next_action:
                yield Text(text=f"{line.what}: {line.next_action}")


def _by_place(lines: Sequence[CheckLine]) -> dict[str, list[CheckLine]]:
    groups: dict[str, list[CheckLine]] = {}
    for line in lines:
        groups.setdefault(line.where, []).append(line)
    return groups


def _worst_verdict(lines: Sequence[CheckLine]) -> str:
    verdicts = {line.verdict for line in lines}
    return next(verdict for verdict in _WORDS if verdict in verdicts)


def _summary(lines: Sequence[CheckLine]) -> str:
    required = [line for line in lines if line.verdict != "shown"]
    held = sum(line.verdict == "ok" for line in required)
    if len(lines) == 1:
        (line,) = lines
        limit = f" (required {line.required})" if line.required and line.verdict == "ok" else ""
        return f"{line.what}: {line.found}{limit}"
    if not required:
        return f"{len(lines)} values read, no requirements"
    headlines = [f"; {line.headline}: {line.found}" for line in lines if line.headline]
    return f"{held} of {len(required)} requirements hold{''.join(headlines)}"
