"""The live signals of a real service: what viewers receive is what the recording contains."""

from __future__ import annotations

import asyncio
import json
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from websockets.asyncio.client import unix_connect

from acquisition.journal.cycle_reader import CycleReader
from acquisition.runs.manifest import RECORDING
from rid_daq.service.sockets import socket_path_of
from tests.rid_daq.service.conftest import PATIENCE_S, ServedProcess
from tests.rid_daq.service.moving import begin_motion, leased_cell
from tests.rid_daq.service.signals.test_signal_view import parse

pytestmark = pytest.mark.slow


async def receive_bins(
    served: ServedProcess, least: int
) -> tuple[dict[str, Any], dict[int, NDArray[Any]]]:
    """Return the newest head and the bins by their numbers.

    It waits for the first bin and for at least `least` bins.
    """
    found: dict[int, NDArray[Any]] = {}
    head: dict[str, Any] = {}
    async with unix_connect(
        str(socket_path_of(served.folder)), "ws://localhost/api/v1/ws"
    ) as socket:
        await socket.send(json.dumps({"signals": "ir361"}))
        while len(found) < least or 0 not in found:
            message = await asyncio.wait_for(socket.recv(), PATIENCE_S)
            if isinstance(message, bytes):
                head, _, rows = parse(message)
                found |= dict(enumerate(rows.T, head["first"]))
    return head, found


def test_viewers_receive_the_extremes_of_the_recording(
    served: ServedProcess, long_motion: str
) -> None:
    with leased_cell(served, long_motion) as lease:
        job = begin_motion(served, lease, pace=5.0)
        head, during = asyncio.run(receive_bins(served, 40))
        assert head["age_s"] < 1.0
        with served.client as client:
            client.stop("ir361")
            run = client.follow(job).job.run
        assert run is not None
        # the stop's last bin arrives after the end of the job, too
        head, bins = asyncio.run(receive_bins(served, len(during)))
    with CycleReader(served.folder / "runs" / run / RECORDING) as reader:
        rows = np.concatenate(list(reader.rows()))
    values = np.array([bins[number] for number in range(len(bins))])
    lanes = {name: 3 + 3 * i for i, name in enumerate(head["lanes"])}
    errors = rows["target_position"] - rows["position"]
    for name, recorded in (
        ("position", rows["position"]),
        ("torque", rows["torque_nm"]),
        ("following_error", errors),
    ):
        low, high = (values[:, lanes[f"{name}_{end}"] :][:, :3] for end in ("low", "high"))
        np.testing.assert_allclose(low.min(axis=0), recorded.min(axis=0), rtol=1e-5, atol=1e-7)
        np.testing.assert_allclose(high.max(axis=0), recorded.max(axis=0), rtol=1e-5, atol=1e-7)
    assert values[0, 0] == 1.0
    assert not values[1:, 0].any()


def test_a_viewer_that_does_not_ask_receives_no_bins(served: ServedProcess, motion: str) -> None:
    async def look(viewer_asks: str) -> bool:
        address = str(socket_path_of(served.folder)), "ws://localhost/api/v1/ws"
        async with unix_connect(*address) as socket:
            await socket.send(json.dumps({"signals": viewer_asks}))
            kinds: list[str] = []
            while kinds.count("samples") < 10:
                message = await asyncio.wait_for(socket.recv(), PATIENCE_S)
                kinds.append(
                    "signals" if isinstance(message, bytes) else json.loads(message)["type"]
                )
            return "signals" in kinds

    with leased_cell(served, motion) as lease:
        begin_motion(served, lease, pace=1.0)
        assert not asyncio.run(look("no such cell"))
        assert asyncio.run(look("ir361"))
