"""What `rid-daq identify` does, and says of it."""

from __future__ import annotations

from rid_daq.jobs.identify_job import IdentifiedRuns, IdentifyRequest, identify_runs
from rid_daq.runs import made_file
from rid_daq.runs.output_file import refuse_output
from rid_daq.terminal.console import Console
from rid_daq.terminal.exit_codes import ExitCode


def perform(request: IdentifyRequest, console: Console) -> None:
    """Identify, and say what was found; exit codes as the command has them."""
    refuse_output(request.output, request.overwrite, made_file.MODEL)
    identified = identify_runs(request, console)
    _print(console, identified)
    if identified.bad_joints or identified.has_mistakes:
        raise SystemExit(ExitCode.DATA_QUALITY)


def _print(console: Console, identified: IdentifiedRuns) -> None:
    result, gains = identified.result, identified.gains
    estimate = result.estimate
    assert estimate is not None
    told = {
        "drive_gains": None
        if gains is None
        else {
            name: {"value": float(value), "std": float(sigma)}
            for name, value, sigma in zip(gains.joint_names, gains.values, gains.sigma, strict=True)
        },
        "plate": result.plate,
        "comparison": result.comparison,
    }
    console.document(
        {
            "model": str(identified.model),
            "estimate": estimate,
            **{name: part for name, part in told.items() if part is not None},
            "notes": identified.notes,
            "clocks": identified.clocks,
            "report": str(identified.report),
        }
    )
    if result.comparison is not None:
        result.comparison.print(console)
    estimate.print(console)
    if result.plate is not None:
        result.plate.print(console)
    if identified.plate_unused:
        console.say("The runs have a force plate's reaction too: --model combined uses it")
    for finding in estimate.findings or ():
        console.say(finding)
    for mistake in estimate.mistakes or ():
        console.verdict(False, mistake.sentence)
        console.say(f"  Change {' or '.join(mistake.change)}; read the run again.")
        for place in mistake.places or ():
            console.say(f"    {place.words}")
        if mistake.alternatives:
            as_good = "; ".join(other.words for other in mistake.alternatives)
            console.say(f"  As good an explanation: {as_good}.")
    if estimate.mistakes == ():
        console.say("No common mistake of wiring, units or files explains the data far better.")
    bad = identified.bad_joints
    console.verdict(not bad, f"Model: {identified.model}")
    console.say(f"Report: {identified.report}")
    if bad:
        console.verdict(
            False,
            f"The model does not explain the torque of {', '.join(bad)}: it is not exported without"
            " --despite-misfit. Correct the files, then identify again.",
        )
        return
    console.next_step(
        "validate", identified.model, "RUN", lead="Next, RUN being one that was not used here"
    )
