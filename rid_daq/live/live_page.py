"""`LivePage`: the live page as a command of the program has it, over all motions of a session."""

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
    """A page that listens already, and shows the motions that it is made an observer of."""

    access: Access
    listener: socket.socket

    def observer(
        self, title: str, samples: MotionSamples, cell: CellConfig, robot: RobotDescription
    ) -> Observer:
        """Return what makes the process that shows a motion (`record_motion`).

        Only who looks on pays for the server: it takes 0.4 s to load.
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
    """Yield a page whose address has been told, where one is wanted.

    Raises:
        ConfigError: It must not be served there, or cannot.
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
    """Return a socket that listens where `access` says.

    Raises:
        ConfigError: It cannot.
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
            f"--listen {access.address}:{access.port}: {error.strerror}; choose another port, or 0"
            " for any that is free",
            code="RID-LISTEN-ADDRESS",
        ) from None
    return listener
