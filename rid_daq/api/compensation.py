"""`Feedforward`: velocities that precompensate the drives' loops; `compensate` computes them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from compensation.feedforward.file import LARGEST_FILE_BYTES, feedforward_content
from config.arrays import FloatArray
from config.formats.json_file import read_content
from config.formats.whole_file import write_whole
from config.load import to_yaml
from rid_daq.api.arguments import as_path, require
from rid_daq.api.console import text_of
from rid_daq.api.model import Model
from rid_daq.api.motion import Motion, cell_reference, public_blocks
from rid_daq.api.payload import Payload
from rid_daq.api.payload_argument import to_request_payload
from rid_daq.api.temporary_files import MODEL, MOTION, request_folder
from rid_daq.blocks.block import AnyBlock
from rid_daq.operations.path.compensate import CompensateRequest, CompensateResult
from rid_daq.operations.path.feedforward import compensate_motion
from rid_daq.runs import made_file
from rid_daq.runs.output_file import refuse_output

MADE = "feedforward.json"


@dataclass(frozen=True, eq=False)
class Feedforward:
    """Velocity feedforward that precompensates the drives' velocity loops along a motion.

    Attributes:
        motion: The motion.
        velocity: Shape (samples, joints). Velocity feedforward, which rid-daq adds to the output of
            its position loops [rad/s or m/s].
        shown: Texts and tables about the feedforward, which `print` shows.
        content: The bytes of the feedforward file.
    """

    motion: Motion
    velocity: FloatArray
    shown: tuple[AnyBlock, ...]
    content: bytes

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write the feedforward file, for `rid-daq record --feedforward`.

        Args:
            path: The file.
            overwrite: Replace an existing feedforward file.

        Raises:
            ConfigError: The file exists already (RID-OUTPUT-EXISTS), or is not a feedforward file.
            RecordingError: The file cannot be written.
        """
        path = as_path("path", path)
        refuse_output(path, overwrite, made_file.FEEDFORWARD)
        write_whole(path, self.content)

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield the blocks of the result."""
        yield from self.shown

    def __str__(self) -> str:
        return text_of(self.blocks())

    def __repr__(self) -> str:
        return str(self)


def compensate(
    motion: Motion,
    model: Model,
    loops: str | Path,
    *,
    reference: str | Path | None = None,
    payload: Payload | str | None = None,
    load_changes: str | Path | None = None,
    temperature: str | None = None,
    despite_misfit: bool = False,
) -> Feedforward:
    """Compute the velocity feedforward with which the drives produce the torques of a motion.

    The torques are those of the model, tau = Y(q, v, a) beta; the feedforward inverts the drives'
    velocity loops (docs/theory.md 13.2).

    Args:
        motion: The motion, planned for the cell that performs it.
        model: The identified robot.
        loops: File of velocity loops that `rid-daq loop` wrote.
        reference: Run folder of a periodic motion. Scale and delay of the feedforward are tuned to
            this run, joint by joint.
        payload: Payload on the flange: an identified payload, `model` (the model's own payload) or
            `none`; with `load_changes`, the payload before the first change.
        load_changes: Load-change file: payloads that the robot takes up or puts down during the
            motion, with their times (docs/reference/files.md).
        temperature: Temperature of the joints, if the friction of the model depends on it; see
            `Model.at_temperature`.
        despite_misfit: Accept a model with `Model.problems`.

    Raises:
        ConfigError: Motion, model, loops and reference run are of different robots or cells; a
            file cannot be read; or a load changes after the motion's end (RID-LOAD-CHANGE-TIME).
        DataQualityError, RecordingError: The reference run cannot be used.
        EstimationError: The model has `Model.problems` (RID-MODEL-MISFIT); the payload did not pass
            its verdict, or is not fully determined; or the model contains a payload, but `payload`
            is None (RID-PAYLOAD-UNSTATED).
        LimitError: The motion exceeds the torque limits with the load at some time.
    """
    described = require("motion", motion, Motion).description
    require("model", model, Model)
    with request_folder() as folder:
        (folder / MOTION).write_text(to_yaml(described), encoding="utf-8")
        model.save(folder / MODEL)
        request = CompensateRequest.of(
            {
                "cell": cell_reference(motion.cell, folder),
                "motion": folder / MOTION,
                "model": folder / MODEL,
                "loop": as_path("loops", loops),
                "output": folder / MADE,
                "reference": None if reference is None else str(reference),
                "payload": to_request_payload(payload, model, folder),
                "load_changes": None
                if load_changes is None
                else as_path("load_changes", load_changes),
                "temperature": temperature,
                "despite_misfit": despite_misfit,
            },
            shown="compensate",
        )
        result = CompensateResult(request, compensate_motion(request))
        content = read_content(folder / MADE, LARGEST_FILE_BYTES)
        rows = np.array(feedforward_content(content, folder / MADE).feedforward)
        shown = public_blocks(result.blocks(), folder)
    return Feedforward(motion, rows, shown, content)
