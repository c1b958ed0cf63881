"""Effect of a payload on the tool's path error if the gears are elastic, for `benchmarks.loaded`.

The softest cell of `benchmarks.elastic_cells` follows a circle with a feedforward that corrects the
deflection. The stiffness is identified without payload, from the signals of the motors. The model
is identified from the same two motions without and with the payload. It is fitted to the motion of
the links, and contains friction that grows with the transmitted torque: without this term, friction
is the mean of both loads, too small at each reversal with the payload, and too large without it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from acquisition.motion.motion_file import parse_motion
from acquisition.processing.periods import average_periods
from benchmarks.elastic import excitation_samples, identify, path_errors, with_gears
from benchmarks.elastic_cells import STIFFNESS, ElasticCell
from benchmarks.paths import CIRCLES, FIRST, circle_text
from config.simulation.plant import MountedBody
from identification.elasticity.elastic_fit import fit_elastic
from identification.estimation.options import EstimationOptions
from identification.model.options import ModelOptions
from identification.payload.carried import carry_own, without_payload

SEED: Final = 100
PAYLOAD: Final = "tool"
LOADED_TERMS: Final = ModelOptions(
    friction_terms=("coulomb", "viscous", "presliding", "load"), payload=True
)


def tool_errors(body: MountedBody, quick: bool) -> dict[str, float]:
    """Return mean tool errors [m] without payload, with it, and with a model of the robot alone.

    Args:
        body: The payload.
        quick: True for short runs.
    """
    cell = ElasticCell.of(SEED, STIFFNESS)
    plant = cell.plant.model_copy(update={"payloads": {PAYLOAD: body}})
    cell = replace(cell, plant=plant)
    empty = identify(cell, SEED, quick, ("motors",))
    robot = with_gears(cell.robot, empty.gears["motors"])
    averages = [replace(each, reaction=None) for each in empty.averages]
    for number in range(2):
        samples = excitation_samples(cell, 10 * SEED + number, quick)
        loaded = cell.drive(samples, 10 * SEED + 3 + number, mounted=PAYLOAD)
        averages.append(average_periods(loaded.recording))
    options = EstimationOptions(model=LOADED_TERMS)
    payload = (False, False, True, True)
    both = fit_elastic(robot, averages, options, payload=payload).estimate()
    alone, carried = without_payload(both), carry_own(both)
    motion = parse_motion(circle_text(CIRCLES[FIRST], 2).encode(), "circle")
    found = {}
    for label, model, mounted in (
        ("empty", alone, None),
        ("loaded", carried, PAYLOAD),
        ("loaded, not in the model", alone, PAYLOAD),
    ):
        errors = path_errors(cell, robot, model, motion, mounted)
        found[label] = errors["corrected, tool"]
        print(
            f"elastic gears, {FIRST}, {label:26s} mean tool error {1e3 * found[label]:.4f} mm"
            f" (without correction of the deflection {1e3 * errors['rigid, tool']:.3f} mm)",
            flush=True,
        )
    return found
