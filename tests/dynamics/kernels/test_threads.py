"""Samples are distributed to several cores; the results do not change."""

from __future__ import annotations

import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynamics.kernels.threads import RANGE_SAMPLES, run_in_ranges
from dynamics.model.inverse_dynamics import regressor_gradient, torque_derivatives
from dynamics.model.robot_model import RobotModel, base_wrench_regressor, regressor

pytestmark = pytest.mark.slow

SAMPLES = 4 * RANGE_SAMPLES + 3
PIECE = RANGE_SAMPLES - 5  # too small for several threads, and not a multiple of eight


@pytest.fixture(autouse=True)
def _three_cores(monkeypatch) -> None:
    monkeypatch.setattr("dynamics.kernels.threads._cores", lambda: 3)


@pytest.fixture
def model(random_arm) -> RobotModel:
    return RobotModel.from_description(random_arm(6, seed=1))


@pytest.fixture
def motion() -> np.ndarray:
    return np.random.default_rng(0).uniform(-2.0, 2.0, (3, SAMPLES, 6))


def in_pieces(function, motion: np.ndarray, *rest: np.ndarray) -> list[np.ndarray]:
    """Call a function of q, v, a (and more arrays) on small parts, one after another."""
    results = []
    for start in range(0, SAMPLES, PIECE):
        piece = slice(start, start + PIECE)
        results.append(function(*motion[:, piece], *(array[piece] for array in rest)))
    if isinstance(results[0], tuple):
        return [np.concatenate(parts) for parts in zip(*results, strict=True)]
    return [np.concatenate(results)]


def test_regressors_are_identical_to_the_last_bit(model, motion) -> None:
    for function in (regressor, base_wrench_regressor):
        pieces = in_pieces(lambda *m, f=function: f(model, *m), motion)
        np.testing.assert_array_equal(function(model, *motion), pieces[0])


def test_gradients_are_identical_to_the_last_bit(model, motion) -> None:
    rng = np.random.default_rng(1)
    theta = rng.standard_normal(len(model.parameter_names))
    weights = rng.standard_normal((SAMPLES, 6, len(theta)))
    q, v, a = motion
    whole = torque_derivatives(model, q, v, a, theta)
    pieces = in_pieces(lambda q, v, a: torque_derivatives(model, q, v, a, theta), motion)
    np.testing.assert_array_equal(whole, pieces)
    whole = regressor_gradient(model, q, v, a, weights)
    pieces = in_pieces(lambda q, v, a, w: regressor_gradient(model, q, v, a, w), motion, weights)
    np.testing.assert_array_equal(whole, pieces)


def test_concurrent_callers_get_their_own_results(model, motion) -> None:
    expected = regressor(model, *motion)
    with ThreadPoolExecutor(4) as callers:
        calls = [callers.submit(regressor, model, *motion) for _ in range(8)]
        for call in calls:
            np.testing.assert_array_equal(call.result(), expected)


@given(st.integers(0, 10 * RANGE_SAMPLES))
def test_every_sample_belongs_to_one_share(samples) -> None:
    computed = np.zeros(samples, dtype=int)

    def fill(first: int, last: int) -> None:
        computed[first:last] += 1

    run_in_ranges(samples, fill)
    assert (computed == 1).all()


def test_the_caller_does_not_wait_for_a_busy_core(monkeypatch) -> None:
    """The caller computes every range of samples that no other thread has started."""
    busy, idle = threading.Event(), ThreadPoolExecutor(1)
    monkeypatch.setattr("dynamics.kernels.threads._pool", lambda: idle)
    idle.submit(busy.wait, 60.0)
    computed = []
    run_in_ranges(SAMPLES, lambda first, _: computed.append(first))
    busy.set()
    idle.shutdown()
    assert computed == list(range(0, SAMPLES, RANGE_SAMPLES))


def test_few_samples_are_computed_in_the_callers_thread() -> None:
    threads = set()
    run_in_ranges(2 * RANGE_SAMPLES - 1, lambda *_: threads.add(threading.current_thread()))
    assert threads == {threading.current_thread()}


class ShareError(Exception):
    pass


@pytest.mark.parametrize("where", ["first", "last"])
def test_an_error_in_a_share_is_raised(where) -> None:
    def fill(first: int, last: int) -> None:
        if (first == 0) == (where == "first"):
            raise ShareError

    with pytest.raises(ShareError):
        run_in_ranges(SAMPLES, fill)


FORK = """
import os, sys
import dynamics.kernels.threads as threads
threads._cores = lambda: 3
seen = []
threads.run_in_ranges(8192, lambda first, last: seen.append(first))  # now the threads are there
child = os.fork()
seen.clear()
threads.run_in_ranges(8192, lambda first, last: seen.append(first))
if child == 0:
    os._exit(0 if sorted(seen) == list(range(0, 8192, threads.RANGE_SAMPLES)) else 1)
_, status = os.waitpid(child, 0)
sys.exit(os.waitstatus_to_exitcode(status))
"""


def test_a_forked_process_has_its_own_threads() -> None:
    run = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", FORK],
        timeout=120.0,
        capture_output=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr.decode()
