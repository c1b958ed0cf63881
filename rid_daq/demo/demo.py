"""`run_demo`: runs the demo twice, compares the results with limits, and writes one report."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

from acquisition.motion.kinds.multipoint import MultipointMotion
from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RunStatus
from config.load import load_cell, to_yaml
from identification.design.two_harmonic import TwoHarmonicOptions, design_two_harmonic
from rid_daq.demo.demo_elastic import ElasticMotions
from rid_daq.demo.demo_paths import PathMotions
from rid_daq.demo.demo_story import DEMO_CELL, Motions, Story
from rid_daq.demo.demo_timing import TimingMotions
from rid_daq.demo.parallel import run_stories
from rid_daq.report.elastic_path_entry import ElasticPathSection
from rid_daq.report.result import Result, WithoutUnmodelled
from rid_daq.report.sections.estimate import EstimateSection
from rid_daq.report.sections.runs import CellSection
from rid_daq.report.sections.timing import Timing
from rid_daq.report.sections.tracking import TrackingSection
from rid_daq.report.sections.validation import TruthCase, ValidationSection
from rid_daq.report.sections.verdict import VerdictCheck, VerdictSection
from rid_daq.report_page.write import write_result
from rid_daq.session.session import mark_unfinished
from rid_daq.session.versions import software_versions
from rid_daq.terminal.choices import DEMO_PERIOD_S
from rid_daq.terminal.context import Context

FLOOR_RATIO_LIMIT = 1.3
INSIDE_FRACTION_LIMIT = 0.9
# Factors by which compensation must reduce the mean and the maximum distance from the path.
PATH_LIMITS = (("circle", (10.0, 6.0)), ("path not used for tuning", (6.0, 4.0)))

# Factors by which correction of the deflection must reduce the tool's mean error: as estimated, and
# as the tracker measures it, with its noise and the errors of the robot file's lengths.
ELASTIC_LIMITS = (12.0, 1.5)


@dataclass(frozen=True)
class Demo:
    """Result of the demo, its folder and its report."""

    result: Result
    folder: RunFolder
    report: Path


def run_demo(
    runs: Path, console: Context, *, seed: int, periods: int, points: int, paths: bool
) -> Demo:
    """Run the demo with and without unmodelled effects on the bundled cell; write the report.

    Args:
        runs: Folder of the run folders.
        console: Shows the progress.
        seed: Random seed of motions and noise.
        periods, points: Number of measured periods, and of random points of the validation motion.
        paths: True to follow paths too, with and without compensation.

    Raises:
        RidDaqError: A step failed.
    """
    started_s = time.monotonic()
    loaded = load_cell(DEMO_CELL)
    folder = RunFolder.create(runs, "demo", kind="demo", software=software_versions())
    console.say(f"Simulated cell {loaded.config.name}, seed {seed}: no hardware moves.")
    with mark_unfinished(folder):
        excitation = design_two_harmonic(
            loaded.robot,
            TwoHarmonicOptions(DEMO_PERIOD_S, seed=seed, periods=periods),
            loaded.config.cycle_time_s,
        )
        validation = MultipointMotion(
            kind="multipoint", robot=loaded.robot.name, points=points, seed=seed
        )
        for name, content in loaded.files.items():
            folder.write(name, content)
        folder.write("motion.yaml", to_yaml(excitation, "The demo's excitation.").encode())
        folder.write("validation.yaml", to_yaml(validation, "The demo's validation.").encode())
        console.say(
            "Excitation trajectory designed by the two-harmonic heuristic and checked"
            " against the limits."
        )
        cycle_s = loaded.config.cycle_time_s
        total_s = sum(
            motion.plan(loaded.robot, cycle_s).duration_s for motion in (excitation, validation)
        )
        chapter = PathMotions.of_cell(loaded.robot, loaded.config, seed) if paths else None
        timed = TimingMotions.of_robot(loaded.robot, excitation) if paths else None
        for part in (chapter, timed):
            total_s += 0.0 if part is None else part.duration_s(loaded.robot, cycle_s)
        elastic = None if chapter is None else ElasticMotions.of_paths(excitation, chapter)
        motions = Motions(excitation, validation, chapter, timed, elastic)
        stories = run_stories(folder, motions, total_s, seed, console)
        on, off = stories[True], stories[False]
        truth = (
            TruthCase.from_estimate("With unmodelled effects", on.estimate),
            TruthCase.from_estimate("Without unmodelled effects", off.estimate),
        )
        presliding = (_presliding(on.estimate), _presliding(off.estimate))
        verdict = _verdict(on.validation, truth, presliding, on, off.elastic)
        title = f"rid-daq demo on the simulated cell {loaded.config.name}"
        result = Result.new(title, loaded.robot.name).with_sections(
            cell=CellSection.of(loaded.config),
            seed=seed,
            runs=(*on.runs, *off.elastic_runs),
            average=on.average,
            estimate=on.estimate,
            validation=on.validation,
            curves=on.curves,
            tracking=on.tracking,
            retiming=on.retiming,
            elastic_path=off.elastic,
            truth=truth,
            without_unmodelled=WithoutUnmodelled(
                average=off.average, estimate=off.estimate, validation=off.validation
            ),
            verdict=verdict,
            timing=Timing(
                elapsed_s=time.monotonic() - started_s,
                created_utc=folder.manifest().created_utc,
                run_ids=(*on.run_ids, *off.run_ids),
                loops=on.loops,
            ),
        )
        report = write_result(folder, result)
        passed = verdict.passed
        folder.finish(RunStatus.COMPLETE, {"verdict": "passed" if passed else "failed"})
    return Demo(result, folder, report)


def _verdict(
    validation: ValidationSection,
    truth: tuple[TruthCase, TruthCase],
    presliding: tuple[str, str],
    story: Story,
    elastic: ElasticPathSection | None,
) -> VerdictSection:
    tracking, retiming = story.tracking, story.retiming
    over = {axis.joint: axis.error_over_floor or 0.0 for axis in validation.axes}
    worst = max(over, key=lambda joint: over[joint])
    on, off = truth
    checks = [
        VerdictCheck.of(
            f"ratio of validation error to floor, worst axis ({worst})",
            over[worst],
            "≤",
            FLOOR_RATIO_LIMIT,
        ),
        VerdictCheck.of(
            "true parameters inside their 95 % intervals, without unmodelled effects",
            100.0 * off.inside / off.of,
            "≥",
            100.0 * INSIDE_FRACTION_LIMIT,
            "%",
        ),
        *([] if tracking is None else _path_checks(tracking)),
        *([] if retiming is None or retiming.driven is None else retiming.driven.checks),
        *([] if elastic is None else _elastic_checks(elastic)),
    ]
    passed = all(line.passed for line in checks)
    reduced = "" if tracking is None else ", path errors are reduced by large factors"
    faster = "" if retiming is None else ", and a path is executed faster within all limits"
    return VerdictSection.of(
        checks,
        "Passed: the model predicts the validation run nearly as well as the true parameters"
        f" do{reduced}{faster}"
        if passed
        else "Failed: see the line marked NO",
        "The floor is the error that remains with the plant's true parameters: noise and"
        f" unmodelled effects. With unmodelled effects, {on.inside} of {on.of} true parameters"
        f" are inside their intervals; without them, {off.inside} of {off.of}. Presliding"
        f" distances, identified from the excitation run: {presliding[0]}; without unmodelled"
        f" effects: {presliding[1]}.",
    )


def _presliding(estimate: EstimateSection) -> str:
    """Return the joints with identified presliding, and their presliding distances."""
    found = [each for each in estimate.parameters if each.name.startswith("dp_")]
    return (
        ", ".join(f"{each.name.removeprefix('dp_')} {1e3 * each.value:.2g} mrad" for each in found)
        or "none"
    )


def _elastic_checks(elastic: ElasticPathSection) -> list[VerdictCheck]:
    """Return the checks of the circle on elastic gears, at the tool."""
    return [
        VerdictCheck.of(
            f"circle on elastic gears: mean error of the tool reduced, {how}",
            before / max(after, 1e-12),
            "≥",
            limit,
            "times",
        )
        for how, (before, after), limit in zip(
            ("estimated", "measured by a tracker"),
            (elastic.estimated_m, elastic.measured_m),
            ELASTIC_LIMITS,
            strict=True,
        )
    ]


def _path_checks(tracking: TrackingSection) -> list[VerdictCheck]:
    """Return the checks of the circle, and of the path that was not used for tuning."""
    checks = []
    for (what, limits), motion in zip(PATH_LIMITS, tracking.motions, strict=True):
        for ratio, words, limit in zip(
            (motion.mean_ratio, motion.max_ratio),
            ("on average", "at its maximum"),
            limits,
            strict=True,
        ):
            text = f"{what}: error reduced {words}"
            checks.append(VerdictCheck.of(text, ratio or 0.0, "≥", limit, "times"))
    return checks
