"""`LivePage`: live page of a command, for all motions of its session."""

from __future__ import annotations

import contextlib
import os
import socket
from collections.abc import Iterator
from dataclasses import dataclass, replace

import click

from acquisition.motion.samples import MotionSamples
from acquisition.session.helper_process import HelperProcess, Observer
from acquisition.task.control_block import ControlBlock
from acquisition.task.ring import Ring
from config.cell.cell import CellConfig
from config.errors import ConfigError
from config.robot.robot import RobotDescription
from rid_daq.live.picture import ShownMotion
from rid_daq.requests.cell_options import Live
from rid_daq.web.access import Access

PATIENCE_S = 2.0
BACKLOG = 128


@dataclass(frozen=True)
class LivePage:
    """Live page with a listening socket; it shows each motion that is recorded with `observer`."""

    access: Access
    listener: socket.socket

    def observer(
        self, title: str, samples: MotionSamples, cell: CellConfig, robot: RobotDescription
    ) -> Observer:
        """Return a function that creates the process that shows a motion (`record_motion`).

        The server is imported only if a live page is wanted, because the import takes 0.4 s.
        """
        from rid_daq.live.live_process import run_live_page

        motion = ShownMotion(title, len(samples), samples.samples_per_period, cell, robot)

        def make(ring: Ring, control: ControlBlock) -> HelperProcess:
            return HelperProcess(
                "live page",
                run_live_page,
                (self.access, self.listener, motion, ring, control, os.getpid()),
                patience_s=PATIENCE_S,
                loss="the motion was not affected",
            )

        return make


@contextlib.contextmanager
def live_page(options: Live) -> Iterator[LivePage | None]:
    """Print the address of a live page and yield the page; yield None if no page is wanted.

    Raises:
        ConfigError: The page must not, or cannot, be served on the address.
    """
    if not options.wanted:
        yield None
        return
    access = Access.of_options(options.listen, options.token, options.certificate)
    access.tls()
    with listen_on(access) as listener:
        access = replace(access, port=listener.getsockname()[1])
        click.echo(
            f"Live page: {access.url}\nIts stop button is software, not an emergency stop.",
            err=True,
        )
        yield LivePage(access, listener)


def listen_on(access: Access) -> socket.socket:
    """Return a listening socket at the address and port that `access` states.

    Raises:
        ConfigError: The address cannot be used.
    """
    family = socket.AF_INET6 if ":" in access.address else socket.AF_INET
    listener = socket.socket(family, socket.SOCK_STREAM)
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind((access.address, access.port))
        listener.listen(BACKLOG)
    except OSError as error:
        listener.close()
        raise ConfigError(
            f"--listen {access.address}:{access.port}: {error.strerror}; choose another port, or"
            " 0 for any free port",
            code="RID-LISTEN-ADDRESS",
        ) from None
    return listener
