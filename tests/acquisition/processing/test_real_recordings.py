"""Import, smoothing and averaging on recordings of a real robot (UR10e)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from acquisition.imports.read import import_csv
from acquisition.maps.import_map import ImportMap, RowRange
from acquisition.processing.imported_periods import resample_periods
from acquisition.processing.periods import average_periods
from acquisition.processing.smoothing import smooth_nonperiodic
from config.errors import DataQualityError
from config.load import load_bundled_or_path, load_robot
from tests.builders.raised_codes import raises_code

SOUND = (
    "ur-20_01_17-ptp_10_points",
    "ur-20_01_22-joint_2",
    "ur-20_01_22-joint_4",
    "ur-20_01_31-load",
    "ur-20_01_31-unload",
    "ur-20_02_10-30sec_12harm",
    "ur-20_02_12-50sec_12harm",
)


def layout(columns: int = 31) -> ImportMap:
    return load_bundled_or_path(f"ur10e_{columns}", "maps", ImportMap)


class TestImport:
    @pytest.mark.parametrize("name", SOUND)
    def test_the_import_of_undamaged_files_uses_every_row(
        self, real_robot: Path, name: str
    ) -> None:
        recording, report = import_csv(real_robot / f"{name}.csv", layout(), load_robot("ur10e"))
        assert report.damaged == ()
        assert report.findings == ()
        assert report.rows_used == len(recording) == report.rows_read
        assert report.step_median_s == pytest.approx(0.010, abs=1e-6)
        assert recording.sample_period_s is None  # alternately 10 and 12 ms
        moving = [ratio for ratio in report.velocity_ratio if ratio is not None]
        assert moving == pytest.approx([1.0] * len(moving), abs=0.005)

    def test_the_import_of_the_damaged_file_reports_rows_2_to_20_and_no_others(
        self, real_robot: Path
    ) -> None:
        recording, report = import_csv(real_robot / "ur-19_09_27-11_32_02.csv", layout(19))
        (damaged,) = report.damaged
        assert (damaged.first, damaged.last) == (2, 20)
        assert dict(damaged.counts) == {"with an absurd value": 13, "whose position jumps": 6}
        assert report.rows_used == 1139 - 19
        assert np.abs(recording.position).max() < 3.0
        assert str(damaged).startswith(
            "rows 2-20: 13 with an absurd value (row 2: position of joint1 is 253, plausible"
        )


class TestSmoothing:
    @pytest.mark.parametrize("name", ["ur-20_02_12-50sec_12harm", "ur-20_01_17-ptp_10_points"])
    def test_the_smoothed_velocity_agrees_with_the_robots_own_velocity(
        self, real_robot: Path, name: str
    ) -> None:
        path = real_robot / f"{name}.csv"
        recording, _ = import_csv(path, layout())
        smooth = smooth_nonperiodic(recording, 9.4)
        raw = np.loadtxt(path, delimiter=",", usecols=range(13))
        for joint in range(6):
            reported = np.interp(smooth.time_s, raw[:, 0], raw[:, 7 + joint])
            assert np.std(smooth.velocity[:, joint] - reported) < 0.02 * np.std(reported)

    def test_smoothing_the_damaged_file_puts_no_rows_into_its_gap(self, real_robot: Path) -> None:
        recording, _ = import_csv(real_robot / "ur-19_09_27-11_32_02.csv", layout(19))
        smooth = smooth_nonperiodic(recording, 9.4)
        assert smooth.time_s.min() > 0.727  # the first sound part starts at row 21
        assert np.abs(smooth.velocity).max() < 1.5


class TestPeriods:
    @pytest.mark.parametrize(("number", "first", "last"), [(2, 387, 5805), (4, 414, 5991)])
    def test_the_periods_of_one_joint_repeat_to_0_03_mrad(
        self, real_robot: Path, number: int, first: int, last: int
    ) -> None:
        import_map = layout().model_copy(
            update={"rows": RowRange(first=first, last=last), "period_s": 10.0}
        )
        recording, _ = import_csv(real_robot / f"ur-20_01_22-joint_{number}.csv", import_map)
        assert recording.samples_per_period == 1000
        average = average_periods(recording)
        assert average.periods_kept >= 4
        deviation_rad = float(np.sqrt(average.position_variance[number - 1]))
        assert 0.01e-3 < deviation_rad < 0.05e-3

    def test_the_run_in_is_out_of_family(self, real_robot: Path) -> None:
        import_map = layout().model_copy(update={"rows": RowRange(first=82, last=5805)})
        recording, _ = import_csv(real_robot / "ur-20_01_22-joint_2.csv", import_map)
        average = average_periods(resample_periods(recording, 10.0))
        (rejected,) = average.rejected
        assert rejected.index == 0
        assert "position of joint 'joint2' differs" in rejected.reason

    def test_a_wrong_period_is_refused(self, real_robot: Path) -> None:
        import_map = layout().model_copy(update={"rows": RowRange(first=387, last=5805)})
        recording, _ = import_csv(real_robot / "ur-20_01_22-joint_2.csv", import_map)
        assert average_periods(resample_periods(recording, 10.0)).periods_kept > 2
        with raises_code(DataQualityError, "RID-IMPORT-PERIOD", "joint2", "10 s"):
            resample_periods(recording, 9.9)
