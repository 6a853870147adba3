"""Parameters of the laws of this package that are not evolved."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from evolution._src.errors import RunError
from evolution._src.references import MAX_MAGNITUDE, MIN_POSITIVE
from reconstruction._src.base.range_checks import as_range, coerce_floats, coerce_integers

NUM_KNOTS = 12  # Knots of `travelling` and `path`: 10 cm apart, finer than a module is long
_MAX_TICKS, _MAX_HIDDEN = 10**9, 1000
_MAX_RATE = 100.0  # Oscillators that change faster than the control ticks would be unstable [1/s]


@dataclass(frozen=True)
class OscillatorConfig:
    """Parameters of `oscillators` that are not evolved."""

    # frequency at a gene of 0 [Hz]; genes change it by factors of 0.35 to 2.8. At 0.25 Hz a servo of 0.8
    # rad/s follows amplitudes up to 0.5 rad.
    frequency: float = 0.25
    # rate at which phases approach their lags [1/s]: faster than the oscillation, slower than a tick
    coupling: float = 4.0
    # rate at which amplitudes approach theirs [1/s]; a body begins to move within a second
    amplitude_rate: float = 8.0
    dt: float = 0.02  # length of a control tick [s], as that of the environment

    def __post_init__(self) -> None:
        names = ("frequency", "coupling", "amplitude_rate")
        coerce_floats(self, dict.fromkeys(names, (MIN_POSITIVE, _MAX_RATE)), RunError)
        coerce_floats(self, {"dt": (MIN_POSITIVE, 1.0)}, RunError)
        if max(self.coupling, self.amplitude_rate) * self.dt > 1.0:
            raise RunError(
                f"coupling {self.coupling}, amplitude_rate {self.amplitude_rate} and dt {self.dt}: rates of at most "
                f"1 / dt = {1 / self.dt:.3g} are needed"
            )


@dataclass(frozen=True)
class ControllerConfig:
    """Parameters of the laws that are not evolved.

    Attributes:
        contact_timeout: ticks without contact after which a module counts as airborne. 15 (0.3 s) bridge the
            flicker of contact; a head that drives over an edge advances by 2.5 cm meanwhile.
        max_airborne_ticks: ticks without contact after which a module no longer keeps its raised posture. 175 (3.5 s);
            without a limit a raised head would never come down again.
        knot_range: position of the first and the last knot of `travelling` and `path`, from the middle of the
            pit [m]. They cover the pit and 0.3 m on either side.
        num_hidden: hidden units of `network`; four keep its search space at 37 genes.
        gene_bound: largest absolute value of a gene, an angle [rad] or gain: nearly the range of a hinge.
        weight_bound: largest absolute value of a weight of `network`; more saturates its tanh.
        oscillators: parameters of `oscillators`; None for the defaults of `OscillatorConfig`.
    """

    contact_timeout: int = 15
    max_airborne_ticks: int = 175
    knot_range: tuple[float, float] = (-0.55, 0.55)
    num_hidden: int = 4
    gene_bound: float = 1.5
    weight_bound: float = 4.0
    oscillators: OscillatorConfig | None = None

    def __post_init__(self) -> None:
        ticks = (0, _MAX_TICKS)
        coerce_integers(
            self,
            {"contact_timeout": ticks, "max_airborne_ticks": ticks, "num_hidden": (1, _MAX_HIDDEN)},
            RunError,
        )
        coerce_floats(
            self, dict.fromkeys(("gene_bound", "weight_bound"), (MIN_POSITIVE, MAX_MAGNITUDE)), RunError
        )
        low, high = as_range("knot_range", self.knot_range, -MAX_MAGNITUDE, MAX_MAGNITUDE, RunError)
        if not low < high:
            raise RunError(f"knot_range is {self.knot_range!r}; first < last is needed")
        object.__setattr__(self, "knot_range", (low, high))

    @property
    def knots(self) -> Float[np.ndarray, " G"]:
        """Positions of the knots [m]."""
        return np.linspace(*self.knot_range, NUM_KNOTS)
