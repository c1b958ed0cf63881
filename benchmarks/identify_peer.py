"""Comparison for `benchmarks.identify`: figaroh identifies the same arrays, in its own Python.

Run it as `PYTHON identify_peer.py DATA`; it prints the seconds and a description of the
computation. The time includes all steps from arrays to estimate: regressor with friction, offset
and actuator inertia, removal of zero columns, base parameters and least squares by figaroh's double
QR decomposition. figaroh's model has no coupled wrist and no cube-root friction.
"""

from __future__ import annotations

import sys
import time
import types

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]
from figaroh.tools.qrdecomposition import QRDecomposer  # pyright: ignore[reportMissingImports]
from figaroh.tools.regressor import (  # pyright: ignore[reportMissingImports]
    build_regressor_basic,
    build_regressor_reduced,
    get_index_eliminate,
)

OPTIONS = {
    "has_friction": True,
    "has_actuator_inertia": True,
    "has_joint_offset": True,
    "act_idxv": list(range(6)),
}


def main() -> int:
    """Identify, and print the time."""
    data = np.load(sys.argv[1])
    q, v, a, tau = (data[name] for name in ("q", "v", "a", "tau"))
    model = pin.Model()
    parent = 0
    for alpha, _, theta, length, d in data["rows"]:
        place = pin.SE3(pin.utils.rotate("x", alpha), np.array([length, 0.0, 0.0]))
        place = place * pin.SE3(pin.utils.rotate("z", theta), np.array([0.0, 0.0, d]))
        parent = model.addJoint(parent, pin.JointModelRZ(), place, f"joint{parent + 1}")
        body = pin.Inertia(1.0, np.zeros(3), np.eye(3))
        model.appendBodyToJoint(parent, body, pin.SE3.Identity())
    robot = types.SimpleNamespace(model=model, data=model.createData())
    joints = range(model.nv)
    names = [f"{symbol}{j}" for j in joints for symbol in "mxyzabcdef"]
    names += [f"{symbol}{j}" for symbol in ("fv", "fs", "ia", "off") for j in joints]
    labels = dict.fromkeys(names, 0.0)

    began_s = time.perf_counter()
    regressor = build_regressor_basic(robot, q, v, a, OPTIONS)
    zero, kept = get_index_eliminate(regressor, labels)
    reduced = build_regressor_reduced(regressor, zero)
    result = QRDecomposer().double_decomposition(tau.T.ravel(), reduced, kept, labels)
    spent_s = time.perf_counter() - began_s
    print(f"{spent_s:.3f} s for {len(result[1])} base parameters")
    return 0


if __name__ == "__main__":
    sys.exit(main())
