"""A simulated user at a terminal who holds keys and reads the output."""

from __future__ import annotations

import contextlib
import os
import pty
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator

REPEAT_S = 0.03
PATIENCE_S = 180.0


class Typist:
    """A command line in a terminal of its own; it runs while the `with` block is active."""

    def __init__(self, *words: object, environment: dict[str, str] | None = None) -> None:
        self._terminal, inside = pty.openpty()
        self.program = subprocess.Popen(
            [sys.executable, "-m", "rid_daq", *map(str, words)],
            stdin=inside, stdout=inside, stderr=inside, start_new_session=True,
            env={**os.environ, "TERM": "dumb", **(environment or {})},
        )  # fmt: skip
        os.close(inside)
        self._shown = b""
        self._reader = threading.Thread(target=self._read, daemon=True)

    def __enter__(self) -> Typist:
        self._reader.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.program.kill()
        self.program.wait()
        self._reader.join()
        os.close(self._terminal)

    def _read(self) -> None:
        with contextlib.suppress(OSError):  # the program has closed its side of the terminal
            while more := os.read(self._terminal, 4096):
                self._shown += more

    @property
    def shown(self) -> str:
        return self._shown.decode(errors="replace")

    def type(self, text: str) -> None:
        os.write(self._terminal, text.encode())

    def wait_for_text(self, text: str, times: int = 1) -> None:
        """Wait until a text has appeared `times` times."""
        wait_for(lambda: self.shown.count(text) >= times or self.program.poll() is not None)
        assert self.shown.count(text) >= times, self.shown

    @contextlib.contextmanager
    def hold_key(self, key: str) -> Iterator[None]:
        """Hold a key while the `with` block is active: it arrives once and then repeatedly."""
        released = threading.Event()

        def repeat() -> None:
            while not released.wait(REPEAT_S):
                self.type(key)

        repeats = threading.Thread(target=repeat, daemon=True)
        repeats.start()
        try:
            yield
        finally:
            released.set()
            repeats.join()

    def wait_for_end(self) -> int:
        return self.program.wait(PATIENCE_S)


def wait_for(condition: Callable[[], bool]) -> None:
    """Wait until a condition is true; fail after a timeout."""
    tick, until_s = threading.Event(), time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < until_s
        tick.wait(0.01)
