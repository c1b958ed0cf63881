"""`FRICTION_FUNCTIONS`: table of the friction functions, with properties for several modules.

The table has one row per function. Three modules compute or write the functions:
- `dynamics.terms.friction` computes a function's values and derivatives. It raises an error for a
  function that it does not support.
- `dynamics.kernels.friction` computes the value for one sample. It does not check the function's
  number: `dynamics.model.one_sample` raises an error for a function without a number.
- `identification.export.function` writes a function's code into an exported file. It raises an
  error for a function that it does not support.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

from config.errors import EstimationError

FrictionFunction = Literal[
    "coulomb", "viscous", "offset", "forward", "backward", "cubic", "cube_root", "stribeck",
    "shear_thinning", "coulomb_by_temperature", "viscous_by_temperature",
]  # fmt: skip
Sign = Literal["braking", "curve", "free"]


@dataclass(frozen=True)
class FunctionTraits:
    """Properties of one friction function.

    Attributes:
        symbol: Symbol of the coefficient; the name of the parameter is SYMBOL_JOINT.
        units: Unit of the coefficient for a revolute joint, and for a prismatic joint.
        sign: Constraint on the coefficient in a physically consistent model. `braking`: it is not
            negative. `curve`: only the joint's total friction must brake, at every speed. `free`:
            no constraint.
        by_direction: True if the function contains sign(v), which the hysteretic direction replaces
            in joints with presliding.
        smooth: True if the function depends on speed and has a finite slope at zero speed.
        kernel: Number of the function in `dynamics.kernels.friction`; None if the function depends
            on temperature, which this kernel does not support.
        words: Name of the function for exports to formats that support only Coulomb and viscous
            friction: the list of omitted effects then contains it. None if such a format can
            contain the function, or if the list describes the omission in another way.
    """

    symbol: str
    units: tuple[str, str]
    sign: Sign
    by_direction: bool = False
    smooth: bool = False
    kernel: int | None = None
    words: str | None = None


_FORCE: Final = ("N m", "N")

FRICTION_FUNCTIONS: Final[dict[FrictionFunction, FunctionTraits]] = {
    "coulomb": FunctionTraits("fc", _FORCE, "braking", by_direction=True, kernel=0),
    "viscous": FunctionTraits(
        "fv", ("N m s/rad", "N s/m"), "braking", smooth=True, kernel=1
    ),
    "offset": FunctionTraits("fo", _FORCE, "free", kernel=2),
    "forward": FunctionTraits("fcp", _FORCE, "braking", by_direction=True, kernel=3),
    "backward": FunctionTraits("fcn", _FORCE, "braking", by_direction=True, kernel=4),
    "cubic": FunctionTraits(
        "f3", ("N m (s/rad)^3", "N (s/m)^3"), "curve", smooth=True, kernel=5, words="cubic"
    ),
    "cube_root": FunctionTraits(
        "fcr", ("N m (s/rad)^(1/3)", "N (s/m)^(1/3)"), "curve", kernel=6, words="cube root"
    ),
    "stribeck": FunctionTraits(
        "fs", _FORCE, "curve", by_direction=True, kernel=7, words="Stribeck"
    ),
    "shear_thinning": FunctionTraits(
        "fvs", ("N m s/rad", "N s/m"), "braking", smooth=True, kernel=8,
        words="shear-thinning viscous",
    ),
    "coulomb_by_temperature": FunctionTraits("fcT", ("N m/K", "N/K"), "free", by_direction=True),
    "viscous_by_temperature": FunctionTraits(
        "fvT", ("N m s/(rad K)", "N s/(m K)"), "free", smooth=True
    ),
}  # fmt: skip


def traits(function: FrictionFunction) -> FunctionTraits:
    """Return the properties of a friction function.

    Raises:
        EstimationError: The table has no such function.
    """
    found = FRICTION_FUNCTIONS.get(function)
    if found is None:
        raise unknown_function(function, "dynamics/terms/friction_functions.py")
    return found


def unknown_function(function: str, where: str) -> EstimationError:
    """Return the error for a friction function that the source file `where` does not support."""
    return EstimationError(
        f"unknown friction function {function!r}: add it to {where}, or leave it out of the model",
        code="RID-MODEL-TERM",
    )
