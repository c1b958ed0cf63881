"""Path error compensation on the command line: loops, feedforward, refinement and tracking."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition.journal.cycles import read_journal
from acquisition.motion.samples import Phase
from acquisition.runs.folder import RunFolder
from acquisition.session.record import record_motion
from acquisition.supervision.stop_reason import StopCode
from compensation.feedforward.tracking_error import tracking_error
from compensation.loops.loop_file import read_loops
from compensation.online.online import OnlineFeedforward
from compensation.online.stream import stream_points
from config.load import load_cell, to_yaml
from config.simulation.faults import FaultScript, FrameFault
from identification.estimation.file import read_estimate
from mock_hw.cell import SimulatedCell
from mock_hw.simulation import CellSimulation
from rid_daq.app import run
from rid_daq.session.cells import hold_reachable_cell
from tests.builders.certified import MEDIUM, write_payload_file
from tests.builders.elastic_model import write_elastic_model
from tests.builders.json_output import document
from tests.builders.motion_texts import CIRCLE, MULTISINE, PICK
from tests.builders.screens import calls_of_command, recorded_calls, require_fitting
from tests.builders.streamed_paths import (
    CHAIN,
    joint_path,
    model_and_loops,
    model_of,
    require_rest_on,
    stream_batches,
)

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def workshop(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a model, velocity loops, and the run of an uncompensated circle."""
    folder = tmp_path_factory.mktemp("compensation")
    # The cell has no force plate, because simulating a plate takes as long as all the rest.
    bundled = load_cell("ir361").config
    arm = bundled.model_copy(update={"plate": None, "name": "arm"})
    (folder / "arm.yaml").write_text(to_yaml(arm))
    cell = str(folder / "arm.yaml")
    runs = ["--runs", str(folder / "runs")]
    (folder / "circle.yaml").write_text(CIRCLE)
    (folder / "multisine.yaml").write_text(MULTISINE)
    excitation = str(folder / "excitation.yaml")
    words = ["design", cell, "-o", excitation, "--method", "two-harmonic", "--periods", "3"]
    assert run(words) == 0
    assert run(["record", cell, excitation, "--label", "excitation", *runs]) == 0
    words = ["identify", "excitation", "--friction-terms", "coulomb,viscous,presliding"]
    assert run([*words, "-o", str(folder / "model.json"), *runs]) == 0
    for label in ("multisine", "circle"):
        motion = str(folder / f"{label}.yaml")
        assert run(["record", cell, motion, "--label", label, *runs]) == 0
    words = ["loop", "multisine", "-o", str(folder / "loops.json"), *runs]
    require_fitting(["loop", "multisine"], calls_of_command(words))
    return folder


@pytest.fixture(scope="module")
def compensated(workshop: Path) -> Path:
    """Return the feedforward of the circle, tuned on the plain run; a run with it is recorded."""
    cell, runs = str(workshop / "arm.yaml"), ["--runs", str(workshop / "runs")]
    circle, ahead = str(workshop / "circle.yaml"), str(workshop / "ahead.json")
    words = ["compensate", cell, circle, *model_and_loops(workshop), "-o", ahead]
    calls = calls_of_command([*words, "--reference", "circle", *runs])
    require_fitting(["compensate", "circle"], calls)
    words = ["record", cell, circle, "--feedforward", ahead, "--label", "compensated", *runs]
    assert run(words) == 0
    return workshop / "ahead.json"


def test_a_reference_run_of_another_cell_is_refused(
    workshop: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = [str(workshop / "circle.yaml"), "--reference", "circle", *model_and_loops(workshop)]
    more = ["--runs", str(workshop / "runs"), "-o", str(workshop / "other.json")]
    assert run(["compensate", "ir361", *words, *more]) == 2
    assert "RID-REFERENCE-CELL" in capsys.readouterr().err


@pytest.mark.usefixtures("drawn_reports")
def test_compensation_reduces_the_circle_error_by_an_order_of_magnitude(
    workshop: Path, compensated: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """In the thesis, the mean path error was 1.42 mm without and 0.25 mm with compensation."""
    loops = json.loads((workshop / "loops.json").read_text())["loops"]
    for axis, gain in zip(loops, (900.0, 1300.0, 250.0), strict=True):
        assert axis["gain"] == pytest.approx(gain, rel=0.02)
    tuning = json.loads(compensated.read_text())["origin"]["tuning"]
    assert (tuning["same_motion"], tuning["used"]) == (True, [True, True, True])
    assert tuning["scale"] == pytest.approx([1.0, 1.0, 1.0], abs=0.1)
    runs = ["--runs", str(workshop / "runs")]
    capsys.readouterr()
    assert run(["tracking", "compensated", "--against", "circle", "--json", *runs]) == 0
    found = document(capsys)
    (motion,) = found["motions"]
    assert motion["use"] == "tuned on it"
    assert 1e-3 < motion["against"]["mean_m"] < 3e-3
    assert motion["mean_ratio"] > 10.0
    assert motion["max_ratio"] > 6.0
    assert found["measured_at"] == "motor encoders"
    assert found["without_stiffness"] == ["axis1", "axis2", "axis3"]
    assert motion["bending"] is None
    page = Path(found["report"]).read_text()
    assert "deviation magnified 10 times" in page
    assert ": error reduced " in page
    assert "does not contain the deflection" in page
    assert "tuned on it" in page
    write_elastic_model(workshop / "model.json", workshop / "stiff.json", joints=[2])
    words = ["tracking", "compensated", "--model", str(workshop / "stiff.json"), "--json", *runs]
    assert run(words) == 0
    found = document(capsys)
    assert found["with_stiffness"] == ["axis3"]
    assert 1e-4 < found["motions"][0]["bending"]["rms_m"] < 5e-3
    assert "for axis1, axis2 also rotor inertia" in found["unseen"]
    assert run(["tracking", "circle", "--against", "compensated", *runs]) == 2
    assert "RID-TRACKING-AGAINST" in capsys.readouterr().err
    assert run(["tracking", "circle", "--against", "circle", *runs]) == 2
    assert "RID-TRACKING-AGAINST" in capsys.readouterr().err


def test_refine_and_tracking_take_the_payload_into_account(
    workshop: Path, compensated: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    runs = ["--runs", str(workshop / "runs")]
    payload = str(write_payload_file(workshop / "payload.json", MEDIUM.parameters))
    write_elastic_model(workshop / "model.json", workshop / "elastic.json", joints=[0, 1, 2])
    bending, corrections, origins = [], [], []
    for name, stated in (("alone", "none"), ("loaded", payload)):
        words = ["tracking", "compensated", "--model", str(workshop / "elastic.json")]
        capsys.readouterr()
        assert run([*words, "--payload", stated, "--json", *runs]) == 0
        bending.append(document(capsys)["motions"][0]["bending"]["rms_m"])
        refined = workshop / f"refined {name}.json"
        words = [
            "refine",
            "compensated",
            *model_and_loops(workshop),
            "--payload",
            stated,
            "-o",
            str(refined),
        ]
        assert run([*words, *runs]) == 0
        file = json.loads(refined.read_text())
        corrections.append(np.array(file["feedforward"]))
        origins.append(file["origin"]["payload"])
    assert bending[1] > 1.1 * bending[0]
    assert np.abs(corrections[1] - corrections[0]).max() > 1e-6
    assert origins == ["none", hashlib.sha256(Path(payload).read_bytes()).hexdigest()]


def test_refinement_reduces_the_error_twentyfold_and_a_grown_error_is_refused(
    workshop: Path, compensated: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    cell, runs = str(workshop / "arm.yaml"), ["--runs", str(workshop / "runs")]
    better = str(workshop / "better.json")
    capsys.readouterr()
    with recorded_calls() as calls:
        assert (
            run(
                ["refine", "compensated", *model_and_loops(workshop), "-o", better, "--json", *runs]
            )
            == 0
        )
    found = document(capsys)
    require_fitting(["refine", "compensated"], calls)
    assert not found["finished"]
    assert all(axis["bound"] < 0.5 for axis in found["axes"])
    circle = str(workshop / "circle.yaml")
    words = ["record", cell, circle, "--feedforward", better, "--label", "refined", *runs]
    assert run(words) == 0
    capsys.readouterr()
    assert run(["tracking", "refined", "--against", "circle", "--json", *runs]) == 0
    (motion,) = document(capsys)["motions"]
    assert motion["use"] == "refined 1 time"
    assert motion["mean_ratio"] > 20.0
    assert motion["max_ratio"] > 10.0

    # Refine again with a changed previous RMS error: first the present error, then half as large.
    (recorded,) = (
        path.parent
        for path in (workshop / "runs").glob("*/feedforward.json")
        if path.read_text() == (workshop / "better.json").read_text()
    )
    for factor, code, verdict in ((1.0, 0, "no longer shrinks"), (0.5, 6, "has grown since")):
        changed = tmp_path / str(factor) / recorded.name
        shutil.copytree(recorded, changed)
        file = json.loads((changed / "feedforward.json").read_text())
        capsys.readouterr()
        again = ["refine", str(recorded), *model_and_loops(workshop), "-o"]
        assert run([*again, str(tmp_path / f"x{factor}.json"), "--json"]) == 0
        rms = [factor * axis["rms"] for axis in document(capsys)["axes"]]
        file["origin"]["refinements"][-1]["rms"] = rms
        RunFolder.open(changed).write("feedforward.json", json.dumps(file).encode())
        again[1] = str(changed)
        assert run([*again, str(tmp_path / f"y{factor}.json")]) == code
        output = capsys.readouterr()
        assert verdict in output.out + output.err
    kept = json.loads((tmp_path / "y1.0.json").read_text())
    assert kept["feedforward"] == json.loads((workshop / "better.json").read_text())["feedforward"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["loop", "circle"], "is of a circle motion"),
        (["compensate", "arm.yaml", "circle.yaml", "--model", "model.json"], "Missing option"),
        (
            ["record", "arm.yaml", "circle.yaml", "--feedforward", "model.json"],
            "RID-FILE-TYPE",
        ),
        (
            ["tracking", "circle", "--against", "multisine"],
            "is of another motion than the given runs",
        ),
        (
            ["refine", "circle", "multisine", "--model", "model.json", "--loop", "loops.json"],
            "differ in motion or feedforward",
        ),
    ],
)
def test_files_of_the_wrong_kind_and_mixed_runs_are_refused(
    workshop: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    words: list[str],
    message: str,
) -> None:
    monkeypatch.chdir(workshop)
    capsys.readouterr()
    more = ["-o", "x.json"] if words[0] in ("compensate", "refine") else []
    assert run([*words, *more, *(["--runs", "runs"] if words[0] != "compensate" else [])]) == 2
    assert message in capsys.readouterr().err


class TestStream:
    """`stream` with points from a file, from another program, and from faulty programs."""

    def test_a_streamed_circle_has_an_error_eight_times_smaller(
        self, workshop: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        arm, circle = str(workshop / "arm.yaml"), str(workshop / "circle.yaml")
        words = ["stream", arm, circle, "--label", "live"]
        require_fitting(words, calls_of_command([*words, *model_of(workshop)]))
        capsys.readouterr()
        runs = ["--runs", str(workshop / "runs")]
        assert run(["tracking", "live", "--against", "circle", "--json", *runs]) == 0
        (motion,) = document(capsys)["motions"]
        assert motion["mean_ratio"] > 8.0
        assert motion["max_ratio"] > 5.0
        assert motion["use"] == "streamed"
        tuned = ["compensate", arm, circle, "--reference", "live"]
        for again in (tuned, ["refine", "live"]):
            capsys.readouterr()
            assert run([*again, *model_of(workshop), "-o", str(workshop / "no.json")]) == 6
            assert "RID-RUN-FOREIGN" in capsys.readouterr().err
        assert not (workshop / "no.json").exists()

    def test_a_path_streamed_with_plain_counts_as_uncompensated(
        self, workshop: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        arm, circle = str(workshop / "arm.yaml"), str(workshop / "circle.yaml")
        words = ["stream", arm, circle, "--plain", "--label", "bare"]
        assert run([*words, *model_of(workshop)]) == 0
        capsys.readouterr()
        runs = ["--runs", str(workshop / "runs")]
        assert run(["tracking", "bare", "--against", "circle", "--json", *runs]) == 0
        (motion,) = document(capsys)["motions"]
        assert motion["use"] == "plain"

    @pytest.mark.fault(3)
    def test_a_streamed_path_with_too_many_lost_answers_gives_exit_code_6(
        self, workshop: Path, capsys: pytest.CaptureFixture[str], measured: Callable[[str], None]
    ) -> None:
        arm = load_cell(str(workshop / "arm.yaml"))
        script = FaultScript(bus=(FrameFault(kind="drop", joint="axis2", probability=0.04),))
        assert arm.plant is not None
        simulation = CellSimulation(arm.config, arm.robot, arm.plant, False, 1, faults=script)
        with SimulatedCell(simulation) as lossy:
            (served := workshop / "lossy.yaml").write_text(to_yaml(lossy.cell))
            capsys.readouterr()
            words = ["stream", str(served), str(workshop / "circle.yaml"), "--json"]
            assert run([*words, *model_of(workshop)]) == 6
        quality = document(capsys)["quality"]
        lost_ratio = quality["lost_answers"]["axis2"] / quality["rows"]
        assert "joint 'axis2': " in quality["trouble"]
        measured(f"'stream': {100 * lost_ratio:.1f} % of a drive's answers are lost: exit code 6")

    def test_an_unknown_path_of_another_program_is_followed_accurately(
        self, workshop: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        path = joint_path()
        code, answer, result = stream_batches(workshop, capsys, [path[:100], path[100:]])
        assert code == 0
        assert answer == {"points": len(path), "error": None}
        rows = read_journal(Path(result["folder"]) / "recording.mcap").rows
        main = rows[rows["phase"] == Phase.MAIN]
        assert main["sample_index"].max() == len(path) - 1
        error = tracking_error(CHAIN, main["target_position"], main["position"])
        assert error.mean_m < 0.25e-3
        assert error.max_m < 1e-3

    def test_the_robot_stops_on_the_path_if_the_client_ends(
        self, workshop: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        path = joint_path()
        code, answer, result = stream_batches(workshop, capsys, [path[:400]], end=False)
        assert code == 4
        assert answer is None
        assert result["stop"]["code"] == "POINTS_LOST"
        require_rest_on(path[:400], result)

    def test_the_robot_stops_before_an_invalid_point_and_the_client_gets_the_reason(
        self, workshop: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        path = joint_path()
        path[400, 1] = np.nan
        code, answer, result = stream_batches(workshop, capsys, [path])
        assert code == 5
        assert answer is not None
        assert {"400,", "axis2:"} <= set(answer["error"].split())
        require_rest_on(path[:400], result)

    def test_an_error_of_a_point_iterator_stops_the_motion_with_its_text(
        self, workshop: Path
    ) -> None:
        cell = load_cell(str(workshop / "arm.yaml"))
        forward = OnlineFeedforward.from_model(
            cell.config,
            cell.robot,
            read_estimate(workshop / "model.json"),
            read_loops(workshop / "loops.json")[1],
        )
        path = joint_path()

        def points() -> Iterator[NDArray[np.float64]]:
            yield path[:1]
            yield from path[1:450]
            raise ValueError("the planner lost its way")

        folder = RunFolder.create(workshop / "runs", "iterator", software={})
        with hold_reachable_cell(cell) as (reachable, _):
            outcome = stream_points(
                reachable, forward, points(),
                lambda source: record_motion(reachable, cell.robot, source, folder),
            )  # fmt: skip
        assert outcome.stop is not None
        assert outcome.stop.code is StopCode.POINTS_LOST
        assert "the planner lost its way" in outcome.stop.text

    def test_contradictory_options_and_a_missing_client_are_refused_before_motion(
        self, workshop: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        given = model_of(workshop)
        arm, circle = str(workshop / "arm.yaml"), str(workshop / "circle.yaml")
        assert run(["stream", arm, circle, "--socket", "/tmp/x", *given]) == 2
        assert "RID-OPTION-EXCLUSIVE" in capsys.readouterr().err
        path = str(workshop / "points")
        assert run(["stream", arm, "--socket", path, "--wait", "0.1", *given]) == 4
        assert "RID-STREAM-CLIENT" in capsys.readouterr().err


def test_a_timed_path_is_compensated_recorded_and_streamed(
    workshop: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    cell, runs = str(workshop / "arm.yaml"), ["--runs", str(workshop / "runs")]
    (tmp_path / "pick.yaml").write_text(PICK)
    pick, fast, ahead = (str(tmp_path / name) for name in ("pick.yaml", "fast.yaml", "ahead.json"))
    capsys.readouterr()
    model = model_and_loops(workshop)[:2]
    assert run(["retime", cell, pick, *model, "-o", fast, "--json"]) == 0
    assert document(capsys)["shorter_percent"] > 20.0
    assert run(["compensate", cell, fast, *model_and_loops(workshop), "-o", ahead]) == 0
    words = ["record", cell, fast, "--feedforward", ahead, "--label", "timed", *runs]
    assert run([*words, *model]) == 0
    assert (
        run(["stream", cell, fast, *model_and_loops(workshop), "--label", "timed-live", *runs]) == 0
    )
    capsys.readouterr()
    assert run(["tracking", "timed", "timed-live", "--json", *runs]) == 0
    for motion in document(capsys)["motions"]:
        assert motion["mean_m"] < 5e-4
