"""Comparison for `benchmarks.judges`: identification and validation by figaroh.

Run it in figaroh's Python as `PYTHON judges_peer.py TRAIN JUDGE`. It prints one JSON list: the
relative error of each joint on the moving samples of the file JUDGE [%]. The model is a regressor
with Coulomb and viscous friction, offset and actuator inertia. The base parameters come from
figaroh's double QR decomposition, and are fitted to the moving samples by least squares.
"""

from __future__ import annotations

import json
import sys
import types

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]
from figaroh.tools.qrdecomposition import QRDecomposer  # pyright: ignore[reportMissingImports]
from figaroh.tools.regressor import (  # pyright: ignore[reportMissingImports]
    build_regressor_basic,
    build_regressor_reduced,
    get_index_eliminate,
)

STANDSTILL_RAD_S = 0.02


def main() -> int:
    """Identify with the arrays of one file, and predict the torques of the other file."""
    train, judge = (np.load(path) for path in sys.argv[1:3])
    model = pin.Model()
    model.gravity.linear = np.asarray(train["gravity"])
    parent = 0
    for alpha, _, theta, length, d in train["rows"]:
        place = pin.SE3(pin.utils.rotate("x", alpha), np.array([length, 0.0, 0.0]))
        place = place * pin.SE3(pin.utils.rotate("z", theta), np.array([0.0, 0.0, d]))
        parent = model.addJoint(parent, pin.JointModelRZ(), place, f"joint{parent + 1}")
        body = pin.Inertia(1.0, np.zeros(3), np.eye(3))
        model.appendBodyToJoint(parent, body, pin.SE3.Identity())
    robot = types.SimpleNamespace(model=model, data=model.createData())
    options = {
        "has_friction": True,
        "has_actuator_inertia": True,
        "has_joint_offset": True,
        "act_idxv": list(range(model.nv)),
    }
    joints = range(model.nv)
    names = [f"{symbol}{j}" for j in joints for symbol in "mxyzabcdef"]
    names += [f"{symbol}{j}" for symbol in ("fv", "fs", "ia", "off") for j in joints]

    def regressor(data: np.lib.npyio.NpzFile) -> np.ndarray:
        return np.asarray(build_regressor_basic(robot, data["q"], data["v"], data["a"], options))

    full = regressor(train)
    zero, kept = get_index_eliminate(full, dict.fromkeys(names, 0.0))
    moving = (abs(train["v"]) > STANDSTILL_RAD_S).T.ravel()
    reduced = build_regressor_reduced(full, zero)[moving]
    decomposer = QRDecomposer()
    result = decomposer.decompose(reduced, kept, train["tau"].T.ravel()[moving])
    columns = build_regressor_reduced(regressor(judge), zero)[:, result.base_indices]
    predicted = (columns @ result.phi_b).reshape(model.nv, -1).T
    counted = abs(judge["v"]) > STANDSTILL_RAD_S
    missed = np.where(counted, judge["tau"] - predicted, 0.0)
    measured = np.where(counted, judge["tau"], 0.0)
    percent = 100.0 * np.linalg.norm(missed, axis=0) / np.linalg.norm(measured, axis=0)
    print(json.dumps([round(float(each), 2) for each in percent]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
