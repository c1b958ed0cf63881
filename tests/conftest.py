"""Settings of each test worker (one BLAS thread, own simulated buses), and common fixtures."""

import os
import tempfile

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# the paths of sockets must be short
os.environ["XDG_RUNTIME_DIR"] = tempfile.mkdtemp(prefix="rid", dir="/tmp")
os.environ["XDG_STATE_HOME"] = tempfile.mkdtemp(prefix="rid", dir="/tmp")

from tests.builders.measured_lines import write_lines  # first, so that every line is measured

# isort: split
import atexit
import gc
import importlib.util
import select
import shutil
import signal
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, settings

from config.cell.amplifier_profile import AmplifierProfile
from config.cell.plate import AmplifierConfig, PlateConfig
from config.load import load_bundled_or_path
from config.simulation.faults import AmplifierFault, FaultScript
from config.simulation.plant import SimulatedPlate
from mock_hw.amplifier.port import AmplifierPort
from mock_hw.amplifier.settings import PlateSettings
from tests.builders.compiled_kernels import forget_stale_kernels
from tests.builders.forked_processes import fork_processes, new_processes
from tests.builders.report_drawings import leave_out_drawings, without_drawings

STEP_S = 0.02
for folder in ("XDG_RUNTIME_DIR", "XDG_STATE_HOME"):
    atexit.register(shutil.rmtree, os.environ[folder], ignore_errors=True)
LONG_TESTS = [
    Path(__file__).parent / place
    for place in (
        "test_thesis.py",
        "test_release.py",
        "test_tutorials.py",
        "rid_daq/workbench",
        "socketcan",
        "rid_daq/commands/test_demo.py",
        "rid_daq/service",
        "rid_daq",
    )
]
"""Tests that start first, in this order: other workers would wait for a long test at the end."""

# Hypothesis uses the same examples in each run and no time limits, so that results are repeatable.
settings.register_profile(
    "repeatable",
    derandomize=True,
    database=None,
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("repeatable")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--fault-page",
        action="store_true",
        help="rewrite the rows of docs/faults.md that belong to the tests that run",
    )
    parser.addoption(
        "--only",
        action="append",
        default=[],
        metavar="PATH",
        help="collect all tests, so that their files are compiled, but run only those in this path",
    )


def pytest_configure(config: pytest.Config) -> None:
    gc.set_threshold(
        50_000, 20, 20
    )  # by default, a worker's million objects are searched too often
    end_by_signals()
    fork_processes()
    if not hasattr(config, "workerinput"):
        forget_stale_kernels(Path(__file__).parents[1])
    if config.getoption("--fault-page") and not hasattr(config, "workerinput"):
        config.pluginmanager.register(FaultPage())


def pytest_sessionfinish() -> None:
    if write_lines is not None:
        write_lines()


def end_by_signals() -> None:
    """Restore default signal handlers, as for a program started from a terminal."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


@pytest.fixture(autouse=True)
def signals() -> Iterator[None]:
    """Restore the signal handlers, because a command that is ending ignores further signals."""
    yield
    end_by_signals()


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Select the tests of `--only`, and move the files of `LONG_TESTS` to the front.

    Then the workers end at about the same time. The rows of `fault` marks are added to the report.
    """
    if places := [Path(place).resolve() for place in config.getoption("--only")]:
        paths = {item.path for item in items if any(map(item.path.is_relative_to, places))}
        config.hook.pytest_deselected(items=[item for item in items if item.path not in paths])
        items[:] = [item for item in items if item.path in paths]
    paths = {item.path for item in items}
    order = {path: [not path.is_relative_to(place) for place in LONG_TESTS] for path in paths}
    items.sort(key=lambda item: order[item.path])
    for item in items:
        rows = [row for mark in item.iter_markers("fault") for row in mark.args]
        item.user_properties += [("fault", row) for row in rows]


class FaultPage:
    """Collect the measured values of the fault tests, in one process or from several test
    workers.
    """

    def __init__(self) -> None:
        path = Path(__file__).parent.parent / "docs" / "fault_page.py"
        spec = importlib.util.spec_from_file_location("fault_page", path)
        assert spec is not None
        assert spec.loader is not None
        self._page = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(self._page)
        self._ran: dict[int, list[object]] = {}
        self._functions: set[str] = set()

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        rows = [int(str(value)) for name, value in report.user_properties if name == "fault"]
        if report.when != "call" or not rows:
            return
        figures = [str(value) for name, value in report.user_properties if name == "measured"]
        function = report.nodeid.split("[", 1)[0]
        entry = self._page.Entry(function, self._page.as_figure("; ".join(figures)))
        self._functions.add(function)
        for row in rows if report.passed else []:
            self._ran.setdefault(row, []).append(entry)

    def pytest_sessionfinish(self) -> None:
        page = self._page.PAGE
        text = page.read_text(encoding="utf-8") if page.exists() else ""
        new = self._page.update(text, self._ran, self._functions, self._page.find_marked())
        page.write_text(new, encoding="utf-8")


RANGES = (1250.0,) * 4 + (5000.0,) * 4
SENSITIVITIES = (-7.5,) * 4 + (-3.8,) * 4


@pytest.fixture
def measured(record_property: Callable[[str, object], None]) -> Callable[[str], None]:
    """Return a function that stores a fault test's measured value for docs/faults.md."""
    return lambda figure: record_property("measured", figure)


@pytest.fixture(scope="session")
def real_robot() -> Path:
    """Folder of recordings of a real UR10e; tests without it are skipped, in CI they fail."""
    root = os.environ.get("RID_DAQ_DATA", "")
    folder = Path(root) / "ur10e"
    if not root or not folder.is_dir():
        reason = "no recordings of a real robot: RID_DAQ_DATA must name the folder of ur10e/"
        if os.environ.get("CI"):
            pytest.fail(f"{reason}; in CI they must be there")
        pytest.skip(reason)
    return folder


class ServedAmplifier(threading.Thread):
    """The simulated amplifier alone at a pseudo-terminal; its time advances while rows stream.

    Its output is a function of its seed and its commands, whatever the computer's speed. After
    `stream_s` of streaming its time stops, and `on_end` is called once.
    """

    def __init__(self, settings: PlateSettings) -> None:
        super().__init__(daemon=True)
        self.plate = settings.plate
        self.profile = settings.profile
        self.address = str(settings.path)
        self.stream_s = 1.0
        self.on_end: Callable[[], None] = lambda: None
        self.base_wrench = np.zeros(6)
        self._port = AmplifierPort(settings, realtime=False)
        self._wake, self._woken = os.pipe()
        self.start()

    def close(self) -> None:
        os.write(self._woken, b"x")
        self.join(120.0)
        self._port.close()
        os.close(self._wake)
        os.close(self._woken)

    def run(self) -> None:
        streamed_s, has_ended, port_fd, greeted = 0.0, False, self._port.fileno(), False
        while True:
            streams = self._port._device.physics.converting
            moves = streams and streamed_s < self.stream_s and (greeted or self._port.fileno() < 0)
            ports = [fd for fd in (self._port.fileno(),) if fd >= 0]
            ready, _, _ = select.select([self._wake, *ports], [], [], 0.0 if moves else 0.05)
            if self._wake in ready:
                return
            if self._port.fileno() != port_fd:
                port_fd, greeted = (
                    self._port.fileno(),
                    False,
                )  # the new port has not been opened yet
            data = self._port.read() if ports else b""
            if data:
                greeted = True
                self._port.receive(data, self.base_wrench)
            elif moves:
                end_s = self._port.time_s + STEP_S
                self._port.apply_loads(end_s, [end_s], [self.base_wrench])
                streamed_s += STEP_S
            elif streams and streamed_s >= self.stream_s and not has_ended:
                has_ended = True
                self.on_end()


Serve = Callable[..., ServedAmplifier]


@pytest.fixture
def serve_amplifier(tmp_path: Path) -> Iterator[Serve]:
    """Return a function that starts a simulated amplifier.

    The function's arguments are the amplifier's faults, the true properties of the plate, the
    amplifier's baud rate, and values that replace those of the amplifier in the cell file.
    """
    served: list[ServedAmplifier] = []

    def serve(
        *faults: AmplifierFault,
        truth: SimulatedPlate | None = None,
        speed: int | None = None,
        **changes: object,
    ) -> ServedAmplifier:
        path = tmp_path / f"amplifier{len(served)}"
        values: dict[str, object] = {
            "address": str(path),
            "baud_rate": 460800,
            "rate_hz": 1000.0,
            "low_pass_hz": 200.0,
            "range_n": RANGES,
            "sensitivity_pc_n": SENSITIVITIES,
        }
        plate = PlateConfig(
            a_m=0.12,
            b_m=0.2,
            az0_m=-0.054,
            position_m=(0.0, 0.0, 0.0),
            rotation_rad=(0.0, 0.0, 0.0),
            amplifier=AmplifierConfig.model_validate(values | changes),
        )
        settings = PlateSettings(
            plate,
            load_bundled_or_path("kistler_style", "profiles", AmplifierProfile),
            truth or SimulatedPlate(sensitivity_pc_n=SENSITIVITIES, noise_v=0.001),
            path,
            seed=7,
            baud_rate=speed,
            faults=FaultScript(seed=3, amplifier=faults),
        )
        served.append(ServedAmplifier(settings))
        return served[-1]

    yield serve
    for amplifier in served:
        amplifier.close()


@pytest.fixture
def new_python_processes() -> Iterator[None]:
    """Let tests start new Python processes, as the program does."""
    with new_processes():
        yield


@pytest.fixture(scope="module")
def plain_reports() -> Iterator[pytest.MonkeyPatch]:
    """Leave out the plots and pictures of the reports that a test file writes.

    A file that uses this fixture is not about drawings; a test that reads them uses
    `drawn_reports` too. Each kind of result is drawn in `tests/rid_daq/report`.
    """
    with without_drawings() as patch:
        yield patch


@pytest.fixture
def drawn_reports(plain_reports: pytest.MonkeyPatch) -> Iterator[None]:
    """Draw the reports that a test writes, in a file that uses `plain_reports`."""
    plain_reports.undo()
    yield
    leave_out_drawings(plain_reports)


@pytest.fixture(scope="module")
def workshop(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with a cell and a short motion."""
    from rid_daq.app import run

    folder = tmp_path_factory.mktemp("workshop")
    assert run(["init", str(folder)]) == 0
    motion = folder / "validation.yaml"
    motion.write_text(motion.read_text().replace("points: 20", "points: 2"))
    return folder
