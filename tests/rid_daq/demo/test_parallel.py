"""Errors of the processes of the demo keep their class, text and code."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

import pytest

from acquisition.motion.kinds.joint_path import JointPathMotion
from acquisition.runs.folder import RunFolder
from config.errors import LimitError
from rid_daq.demo.demo_story import Motions
from rid_daq.demo.parallel import run_stories
from rid_daq.terminal.console import Console

pytestmark = pytest.mark.slow


def test_an_error_of_a_workflow_keeps_its_code(tmp_path: Path) -> None:
    far = JointPathMotion(
        kind="joint_path", robot="ir361", points=((0.0, 0.0, 0.0), (99.0, 0.0, 0.0))
    )
    motions = Motions(cast(Any, far), cast(Any, far), None, None, None)
    with pytest.raises(LimitError) as caught:
        run_stories(RunFolder.create(tmp_path, "demo"), motions, 1.0, 1, Console())
    assert caught.value.refusal == "RID-MOTION-LIMIT"
