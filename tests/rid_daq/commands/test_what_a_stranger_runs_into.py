"""Problems that external testers found, and the tests that cover them."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from benchmarks.mistakes_made import UserFiles
from benchmarks.sound_robots import sound_run
from config.load import load_robot, to_yaml
from config.robot.nominal_links import nominal_links
from config.robot.robot import RobotDescription
from dynamics.geometry.kinematics import Chain
from rid_daq.app import run

ROOT = Path(__file__).parents[3]
MADE = "tests/rid_daq/commands/test_mistakes.py::test_each_mistake_is_refused_or_named"
HERE = "tests/rid_daq/commands/test_what_a_stranger_runs_into.py::"
IMPORT = "tests/rid_daq/commands/test_import.py::"
COMMANDS = "tests/rid_daq/commands/test_commands.py::"
REAL = "tests/rid_daq/commands/test_real_robot_commands.py::"
PAYLOAD = "tests/payload/test_payload_commands.py::"
IMPORTED = "tests/payload/test_imported_runs.py::"
MISFIT = "tests/rid_daq/commands/test_mistakes.py::"

HELD: dict[str, tuple[str, ...]] = {
    "an axis turns the wrong way": (
        "tests/rid_daq/commissioning/test_axes.py"
        "::test_a_reversed_axis_is_found_within_two_degrees_and_the_other_axes_pass",
        MADE,
    ),
    "the DH convention": (
        MADE,
        MISFIT + "test_a_model_with_a_poor_fit_is_not_exported",
    ),
    "an encoder's resolution": (MADE,),
    "swapped columns": (
        MADE,
        MISFIT + "test_swapped_columns_are_reported_with_the_keys_and_lines_to_change",
    ),
    "another robot's file": (HERE + "test_a_file_of_another_robot_is_detected_by_the_residuals",),
    "a torque constant": (
        MADE,
        IMPORT + "test_a_serious_mistake_gives_exit_code_6_and_its_likely_cause",
    ),
    "a load mass in grams or halved": (
        REAL + "test_a_load_mass_that_needs_an_implausible_drive_gain_is_refused",
        "tests/config/test_plausible.py::test_a_number_in_another_unit_is_refused_with_its_option",
    ),
    "a known mass that contradicts the data": (
        PAYLOAD + "test_the_mass_of_another_payload_fails_the_verdict",
        PAYLOAD + "test_a_mass_in_grams_is_refused_before_any_file_is_read",
    ),
    "something left on the flange": (
        IMPORTED + "test_a_body_left_on_the_flange_is_found_with_a_model_of_the_robot",
        "tests/rid_daq/recording/test_empty_flange.py"
        "::test_the_verdict_states_that_the_user_confirmed_the_empty_flange",
    ),
    "half the payload left on the flange": (
        IMPORTED + "test_a_heavy_body_left_on_the_flange_is_named_as_the_likely_mistake",
    ),
    "a zero position, a length": (
        MADE,
        HERE + "test_the_guide_lists_mistakes_that_data_cannot_show",
    ),
    "units in files": (
        HERE + "test_check_refuses_a_value_in_a_wrong_unit",
        "tests/config/test_plausible.py::test_a_command_refuses_limits_in_degrees",
    ),
    "a coupling": (
        MADE,
        HERE + "test_physical_consistency_is_reported_together_with_the_residuals",
    ),
    "the wiring diagnosis": (
        MADE,
        MISFIT + "test_a_valid_recording_is_graded_good_without_findings",
    ),
    "doubled time stamps": (
        IMPORT + "test_a_serious_mistake_gives_exit_code_6_and_its_likely_cause",
        IMPORT + "test_omitted_rows_are_counted_by_reason_and_the_map_sets_their_limit",
    ),
    "a clock that is 10 % off": (
        IMPORT + "test_a_possible_mistake_is_a_finding_in_the_report",
        HERE + "test_a_wrong_clock_of_a_real_recording_is_reported_with_its_factor",
    ),
    "a stuck current": (
        MADE,
        IMPORT + "test_a_possible_mistake_is_a_finding_in_the_report",
    ),
    "swapped currents in the runs of a payload": (
        PAYLOAD + "test_a_session_with_swapped_currents_of_two_axes_fails",
    ),
    "intervals of the procedures model and apart": (
        PAYLOAD + "test_every_procedure_identifies_a_real_payload_within_its_interval",
    ),
    "few seconds": (MISFIT + "test_a_short_recording_gives_wide_intervals_and_a_finding",),
    "a parameter at its bound": (REAL + "test_a_parameter_at_its_bound_is_marked_in_every_output",),
    "zeros of drawings": (HERE + "test_zero_inertias_of_cad_data_are_not_used_as_prior",),
    "a model of another robot": (
        MISFIT + "test_a_model_of_another_robot_is_refused",
        "tests/rid_daq/operations/test_cell_files.py"
        "::test_every_command_with_a_cell_compares_the_model_with_its_robot",
        "tests/rid_daq/operations/test_cell_files.py"
        "::test_refine_and_payload_compare_the_model_with_the_robot",
    ),
    "a validation that proves nothing": (
        COMMANDS + "test_validation_on_the_identification_run_gives_no_verdict",
        COMMANDS + "test_a_too_short_run_gives_a_verdict_only_together_with_others",
    ),
    "an early end": (
        "tests/rid_daq/commands/test_payload_interrupted.py"
        "::test_a_session_resumes_after_ctrl_c_and_until_mass_ends_its_runs_early",
    ),
    "a validation without limits": (
        MISFIT + "test_validation_fails_on_an_unpredicted_recording_even_without_limits",
        "tests/rid_daq/commands/test_init.py"
        "::test_files_of_init_load_and_the_motions_keep_the_limits",
    ),
    "no time column, two files, a zero offset, a ROS bag, torques of the motor side": (
        HERE + "test_a_map_with_rate_and_zero_offset_reads_rows_without_time_stamps",
        IMPORT + "test_a_run_of_two_source_files_contains_and_reads_both",
        IMPORT + "test_a_ros_bag_is_imported_identified_and_validated",
        IMPORT + "test_a_serious_mistake_gives_exit_code_6_and_its_likely_cause",
    ),
    "one jump of a clock": (HERE + "test_rows_after_a_jump_of_the_clock_are_used",),
    "limits, static recordings": (
        IMPORT + "test_a_serious_mistake_gives_exit_code_6_and_its_likely_cause",
        IMPORT + "test_a_static_recording_validates_the_gravity_of_a_model",
    ),
    "a selected model on another motion": (
        REAL + "test_a_model_selected_on_training_runs_predicts_another_motion",
    ),
    "a selected friction term that is insignificant": (
        HERE + "test_no_friction_term_is_selected_that_is_insignificant",
    ),
    "a payload with a selected friction model": (
        PAYLOAD + "test_a_model_with_its_own_friction_terms_identifies_a_payload",
        PAYLOAD + "test_friction_terms_are_an_option_if_no_model_contains_them",
    ),
    "a report of several models": (
        REAL + "test_a_report_contains_only_sections_of_the_latest_model",
    ),
    "payload identification as in the guide": (
        HERE + "test_the_guide_identifies_a_payload_with_an_unloaded_run",
    ),
    "sources that are cited": ("tests/test_theory.py",),
    "friction of a coupled wrist": (
        "tests/rid_daq/commands/test_friction.py",
        HERE + "test_the_guide_states_that_wrist_friction_is_per_motor",
    ),
}
"""Mistakes with their tests: 26 that once gave no message, and ten with imported recordings."""


@pytest.mark.parametrize("found", HELD)
def test_each_listed_mistake_has_an_existing_test(found: str) -> None:
    assert len(HELD) == 36
    for name in HELD[found]:
        path, _, test = name.partition("::")
        assert f"def {test}" in (ROOT / path).read_text(encoding="utf-8")


def guide_text(name: str) -> str:
    return " ".join((ROOT / "docs" / "guide" / name).read_text(encoding="utf-8").split())


def test_the_guide_lists_mistakes_that_data_cannot_show() -> None:
    listed = guide_text("find-a-mistake.md").partition("## What can go wrong")[2]
    for words in ("vertical first axis", "torque constant", "load of known mass", "lengths"):
        assert words in listed
    for words in ("a clock that is 10 % off", "a fifth too long", "30° off"):
        assert words in listed


def test_the_guide_identifies_a_payload_with_an_unloaded_run() -> None:
    assert "rid-daq payload identify --unloaded without" in guide_text("someone-elses-recording.md")


def test_the_guide_states_that_wrist_friction_is_per_motor() -> None:
    assert "coupled wrist, the result is each motor's friction" in guide_text("friction.md")


Engineer = Callable[..., SimpleNamespace]


@pytest.fixture(scope="module")
def sound() -> UserFiles:
    made = sound_run(load_robot("ir361"), np.random.default_rng(1))
    return UserFiles.of(made)


@pytest.fixture
def import_and_identify(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Engineer:
    """Return a function that imports a recording with an engineer's files and identifies it."""

    def run_commands(
        stated: UserFiles, *options: str, map_text: str | None = None
    ) -> SimpleNamespace:
        table = np.column_stack([stated.time_s, stated.position, stated.torque_nm])
        np.savetxt(tmp_path / "rec.csv", table, delimiter=",", fmt="%.9g")
        (tmp_path / "robot.yaml").write_text(to_yaml(stated.robot))
        (tmp_path / "map.yaml").write_text(map_text or stated.map_text)
        runs = ["--runs", str(tmp_path / "runs")]
        words = ["import", str(tmp_path / "rec.csv"), "--map", str(tmp_path / "map.yaml"), "--json"]
        capsys.readouterr()
        assert run([*words, *runs]) == 0
        imported = json.loads(capsys.readouterr().out)
        words = ["identify", imported["folder"], *runs, *options, "--overwrite"]
        code = run([*words, "--json"])
        document: dict[str, Any] = json.loads(capsys.readouterr().out)
        return SimpleNamespace(code=code, imported=imported, words=words, **document)

    return run_commands


def test_a_file_of_another_robot_is_detected_by_the_residuals(
    import_and_identify: Engineer, sound: UserFiles
) -> None:
    rows = load_robot("kr15").kinematics.rows[:3]
    kinematics = sound.robot.kinematics.model_copy(update={"rows": rows})
    other = sound.robot.model_copy(update={"kinematics": kinematics})
    found = import_and_identify(replace(sound, robot=other))
    assert found.code == 6
    assert "doubtful" in [axis["grade"] for axis in found.estimate["axes"]]


def test_physical_consistency_is_reported_together_with_the_residuals(
    import_and_identify: Engineer, sound: UserFiles, capsys: pytest.CaptureFixture[str]
) -> None:
    found = import_and_identify(sound)
    assert found.code == 0
    assert run(found.words) == 0
    output = capsys.readouterr().out
    assert "possible robot" in output
    assert "residual" in output


def with_cad_links(robot: RobotDescription, inertia: tuple[float, ...]) -> RobotDescription:
    """Return a robot with CAD data of its links and a given inertia of the last link."""
    chain = Chain.from_description(robot)
    links = [
        link.model_copy(update={"uncertainty": 0.1})
        for link in nominal_links(chain.rows, chain.tool_m)
    ]
    links[-1] = links[-1].model_copy(update={"inertia_kg_m2": inertia})
    return robot.model_copy(update={"cad": tuple(links)})


def test_zero_inertias_of_cad_data_are_not_used_as_prior(
    import_and_identify: Engineer, sound: UserFiles
) -> None:
    values = {}
    for name, options in (("data", ()), ("drawn", ("--cad-prior",))):
        stated = replace(sound, robot=with_cad_links(sound.robot, (0.0,) * 6))
        found = import_and_identify(stated, "--no-diagnose", *options)
        values[name] = {p["name"]: (p["value"], p["std"]) for p in found.estimate["parameters"]}
    for name in ("Ixx3", "Ixy3", "Izz3"):
        (value, sigma), (drawn_value, drawn_sigma) = values["data"][name], values["drawn"][name]
        assert abs(drawn_value - value) < 0.5 * sigma
        assert drawn_sigma > 0.8 * sigma


def test_no_friction_term_is_selected_that_is_insignificant(
    import_and_identify: Engineer, sound: UserFiles
) -> None:
    """The recording lasts nine seconds, and no joint has load-dependent friction."""
    short = sound.time_s < 9.0
    cut = {key: getattr(sound, key)[short] for key in ("time_s", "position", "torque_nm")}
    found = import_and_identify(replace(sound, **cut), "--choose")
    chosen = found.comparison["chosen"]
    assert not any("load" in terms for terms in chosen.values())
    for entry in found.estimate["parameters"]:
        if entry["name"].startswith("cl_"):
            assert abs(entry["value"]) > 2.0 * entry["std"]
    assert sum(found.comparison["with_terms"]) <= 1.02 * sum(found.comparison["plain"])


A12 = [
    ("robot", "position_max: 2.7", "position_max: 155.0", "155 degrees would be 2.705 rad"),
    ("robot", "a_m: 0.480", "a_m: 480.0", "480 mm would be 0.48 m"),
    ("robot", "alpha_rad: 1.5707963267948966", "alpha_rad: 90.0", "90 degrees would be 1.571 rad"),
    ("robot", "0.0, 9.81]", "0.0, 981.0]", "981 cm/s² would be 9.81 m/s²"),
    ("robot", "torque: 600.0", "torque: 600000.0", "600000 N mm would be 600 N m"),
    ("cell", "error_rad: 0.1", "error_rad: 5.7", "5.7 degrees would be 0.09948 rad"),
    ("cell", "position_gain_per_s: 15.0", "position_gain_per_s: 0.01", "0.01 1/ms would be 10 1/s"),
]


@pytest.mark.parametrize(("file", "right", "wrong", "message"), A12)
def test_check_refuses_a_value_in_a_wrong_unit(
    file: str,
    right: str,
    wrong: str,
    message: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    texts = {
        kind: files("config").joinpath(f"bundled/{kind}s/ir361.yaml").read_text()
        for kind in ("cell", "robot")
    }
    assert right in texts[file]
    texts[file] = texts[file].replace(right, wrong, 1)
    texts["cell"] = texts["cell"].replace("robot: ir361", "robot: robot.yaml")
    for kind, text in texts.items():
        (tmp_path / f"{kind}.yaml").write_text(text)
    assert run(["check", str(tmp_path / "cell.yaml")]) == 2
    assert message in " ".join(capsys.readouterr().err.split())


def test_a_wrong_clock_of_a_real_recording_is_reported_with_its_factor(
    real_robot: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = np.loadtxt(real_robot / "ur-20_01_31-unload.csv", delimiter=",")[300:1800]
    words = ["import", str(tmp_path / "rec.csv"), "--map", "ur10e_31"]
    words += ["--runs", str(tmp_path / "runs"), "--json"]
    for clock, is_reported in ((1.0, False), (1.1, True)):
        table[:, 0] *= clock
        np.savetxt(tmp_path / "rec.csv", table, delimiter=",", fmt="%.9g")
        assert run(words) == 0
        findings = json.loads(capsys.readouterr().out)["findings"]
        clock_findings = [each for each in findings if each.startswith("The clock is wrong")]
        assert bool(clock_findings) is is_reported
    assert "Multiply the times by 0.9" in clock_findings[0]


def test_a_map_with_rate_and_zero_offset_reads_rows_without_time_stamps(
    import_and_identify: Engineer, sound: UserFiles
) -> None:
    turned = sound.position + np.array([0.0, 0.5, 0.0])
    text = sound.map_text.replace("time: {column: 0}", "rate_hz: 100.0")
    text = text.replace("position: 2,", "position: 2, zero_offset: 0.5,")
    right = import_and_identify(sound, "--no-diagnose")
    turned_back = replace(sound, position=turned)
    found = import_and_identify(turned_back, "--no-diagnose", map_text=text)
    assert (right.code, found.code) == (0, 0)
    plain, read = ([p["value"] for p in each.estimate["parameters"]] for each in (right, found))
    np.testing.assert_allclose(read, plain, rtol=1e-3, atol=1e-3)


def test_rows_after_a_jump_of_the_clock_are_used(
    import_and_identify: Engineer, sound: UserFiles
) -> None:
    """From row 1500 on, all time stamps are 9.8 ms too early."""
    time_s = sound.time_s.copy()
    time_s[1500:] -= 0.0098
    text = sound.map_text + "plausible: {position: 7.0, speed: 2.7, torque: 800.0}\n"
    late = replace(sound, time_s=time_s)
    found = import_and_identify(late, "--no-diagnose", map_text=text)
    assert any("The clock jitters" in each for each in found.imported["findings"])
    assert found.imported["rows_damaged"] <= 2
    assert found.imported["rows_used"] >= len(time_s) - 2
