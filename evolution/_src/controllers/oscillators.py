"""Coupled oscillators: a central pattern generator with one phase oscillator for each hinge, on any tree of modules.

With theta the phase, r the amplitude and x the target of hinge i, p its parent (the next hinge on the way to the head,
or a clock at the head) and c its children:

    dtheta_i/dt = 2 pi f + w sin(theta_p - theta_i - lag_i) + sum_c w sin(theta_c - theta_i + lag_c) - s N_i cos theta_i
    d2r_i/dt2   = a (a / 4 (R_i - r_i) - dr_i/dt)
    x_i         = offset_i + r_i cos(theta_i) + gain_ahead * inclination ahead + gain_behind * pitch

A module with two rotational degrees of freedom turns its arm, too, with the phase of its hinge and a smooth start:

    x_twist = twist_offset_i + twist_amplitude_i min(clock, 1) cos(theta_i - twist_lag_i)

References:
    Ijspeert (2008), Central pattern generators for locomotion control in animals and robots: a review, Neural Networks
    21(4). Phases, amplitudes and steering by different amplitudes to the left and right: Ijspeert, Crespi, Ryczko and
    Cabelguen (2007), From swimming to walking with a salamander robot driven by a spinal cord model, Science 315.
    Owaki, Kano, Nagasawa, Tero and Ishiguro (2013), Simple robot suggests physical interlimb communication is essential
    for quadruped walking, J. R. Soc. Interface 10: the feedback - s N cos theta from ground contact.

    Differs: couplings are not weighted by amplitudes, so that a resting hinge passes the rhythm on; N is 1 or 0.
"""

from math import pi
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from evolution._src.controllers.joints import (
    GOAL_SENSOR,
    Drive,
    Joints,
    add_to_column,
    compute_bearing,
    find_namespace,
)
from evolution._src.controllers.protocol import Structure

FREQUENCY = 0.25
"""Frequency at a gene of 0 [Hz]; genes change it by factors of 0.35 to 2.8. At 0.25 Hz a servo of 0.8 rad/s follows
amplitudes up to 0.5 rad."""
COUPLING = 4.0
"""Rate at which phases approach their lags [1/s]: faster than the oscillation, slower than a tick."""
AMPLITUDE_RATE = 8.0  # Rate at which amplitudes approach theirs [1/s]; a body begins to move within a second
DT = 0.02  # Length of a control tick [s], as that of the environment
COMMON_GENES = ("log2_frequency", "pitch_ahead", "pitch_behind", "contact_feedback")
"""Genes of all hinges: frequency as a power of 2, gains on inclinations, and s [rad/s]."""
SIDE_GENES = ("side_bias", "side_steering")
"""Genes of bodies with hinges on both sides: smaller strokes on the left, and a gain of that on the goal's bearing."""
KIND_GENES = ("amplitude", "offset", "lag")  # Genes of each kind of docking [rad]
TWIST_GENES = ("twist_amplitude", "twist_offset", "twist_lag")
"""Likewise of the rotations of arms, where modules have them [rad]."""
_ANGLES = ("lag_", "twist_lag_")  # Beginnings of the names of genes that are phases, which go all around
_HINTS = {"back": (0.3, 0.0, 1.0), "left": (0.3, 0.0, 0.0), "right": (0.3, 0.0, pi / 2)}
"""Genes of each kind of docking at which a search with a hint begins: a wave along the spine, legs in turn."""


class OscillatorState(NamedTuple):
    """The memory of oscillators between ticks."""

    has_begun: Bool[Any, "P 1"]  # whether a tick has passed; phases begin at their lags
    clock: Float[Any, "P 1"]  # phase at the head [rad]
    phase: Float[Any, "P h"]  # of each hinge [rad]
    amplitude: Float[Any, "P h"]  # of each hinge [rad]
    amplitude_rate: Float[Any, "P h"]  # its change [rad/s]


class OscillatorController:
    """Coupled oscillators on a body: it follows `Controller`. Actions are relative to the ranges of joints [rad]."""

    name, version = "oscillators", "1"

    def __init__(
        self, joints: Joints, drive: Drive, hinge_range: float, twist_range: float, bound: float
    ) -> None:
        self.joints, self.drive, self.hinge_range, self.twist_range = joints, drive, hinge_range, twist_range
        self.parent = _find_parents(joints)
        self.can_steer = {1.0, -1.0} <= set(joints.side.tolist())  # whether there are hinges on both sides
        rolls = ("roll",) if joints.has_rolls else ()
        goal = (GOAL_SENSOR,) if self.can_steer or drive.can_turn else ()
        self.sensors = ("hinge_angle", "pitch", "contact", *rolls, *goal)
        genes = drive.genes | dict.fromkeys(COMMON_GENES, 0.0)
        genes |= dict(zip(SIDE_GENES, (0.0, 1.0), strict=True)) if self.can_steer else {}
        twists = TWIST_GENES if joints.num_twists else ()
        for kind in (side for side in _HINTS if side in joints.dock):
            genes |= {f"{gene}_{kind}": value for gene, value in zip(KIND_GENES, _HINTS[kind], strict=True)}
            genes |= {f"{gene}_{kind}": 0.0 for gene in twists}
        self.parameters, self.initial = tuple(genes), tuple(genes.values())
        self.upper = tuple(pi if gene.startswith(_ANGLES) else bound for gene in genes)
        self.lower = tuple(-value for value in self.upper)

    def begin(self, count: int) -> OscillatorState:
        """Return the state of `count` controllers before their first observation."""
        clock, hinges = np.zeros((count, 1)), np.zeros((count, len(self.joints.own)))
        return OscillatorState(clock > 0, clock, hinges, hinges.copy(), hinges.copy())

    def act(
        self,
        observation: Float[Any, "P O"],
        genotype: Float[Any, "*P G"],
        structure: Structure,
        state: OscillatorState,
    ) -> tuple[Float[Any, "P A"], OscillatorState]:
        """Compute actions in [-1, 1], hinge targets as a share of their range, then track speeds."""
        xp = find_namespace(observation)
        genes = xp.broadcast_to(genotype, (len(observation), len(self.parameters)))
        gene = {name: genes[:, index : index + 1] for index, name in enumerate(self.parameters)}
        amplitude, offset, lag = (self._spread(gene, name) for name in KIND_GENES)
        if self.can_steer:  # smaller strokes on the side to which the body turns
            turn = gene["side_bias"] + gene["side_steering"] * compute_bearing(observation, structure)
            amplitude = amplitude * (1.0 - xp.clip(turn, -1.0, 1.0) * self.joints.side)
        pitch, contact, *roll = (
            xp.asarray(observation[:, structure[name]], dtype=float)
            for name in self.sensors[1:]
            if name != GOAL_SENSOR
        )
        state = self._step(state, gene, amplitude, lag, contact[:, self.joints.own] > 0)
        ahead = self.joints.compute_inclination_ahead(pitch, *roll)
        reflex = gene["pitch_ahead"] * ahead + gene["pitch_behind"] * pitch[:, self.joints.own]
        target = (offset + state.amplitude * xp.cos(state.phase) + reflex) / self.hinge_range
        twists = xp.zeros((len(target), 0))
        if self.joints.num_twists:
            size, middle, delay = (self._spread(gene, name) for name in TWIST_GENES)
            stroke = xp.clip(state.clock, 0.0, 1.0) * xp.cos(state.phase - delay)
            twists = (middle + size * stroke) / self.twist_range
        tracks = self.drive.act(genes[:, : len(self.drive.genes)], observation, structure)
        return xp.concatenate((xp.clip(target, -1.0, 1.0), xp.clip(twists, -1.0, 1.0), tracks), axis=1), state

    def _spread(self, gene: dict[str, Float[Any, "P 1"]], name: str) -> Float[Any, "P h"]:
        """Return the gene of each hinge's kind of docking."""
        first = gene["log2_frequency"]
        columns = [gene[f"{name}_{dock}"] for dock in self.joints.dock]
        return find_namespace(first).concatenate((first[:, :0], *columns), axis=1)

    def _step(
        self,
        state: OscillatorState,
        gene: dict[str, Float[Any, "P 1"]],
        amplitude: Float[Any, "P h"],
        lag: Float[Any, "P h"],
        touches: Bool[Any, "P h"],
    ) -> OscillatorState:
        """Return the state one tick later (explicit Euler)."""
        xp = find_namespace(lag)
        dt, rate = DT, AMPLITUDE_RATE
        behind = lag.copy()  # each hinge behind the clock
        for hinge in np.argsort(self.joints.depth, kind="stable"):
            if self.parent[hinge] != hinge:
                behind = add_to_column(behind, hinge, behind[:, self.parent[hinge]])
        phase = xp.where(state.has_begun, state.phase, state.clock - behind)
        is_root = self.parent == np.arange(len(self.parent))
        before = xp.where(is_root, state.clock, phase[:, self.parent])
        pull = xp.sin(before - phase - lag)
        turn = 2.0 * pi * FREQUENCY * xp.exp2(gene["log2_frequency"])
        change = turn + COUPLING * pull - gene["contact_feedback"] * touches * xp.cos(phase)
        for child in np.flatnonzero(~is_root):
            change = add_to_column(change, self.parent[child], -(COUPLING * pull[:, child]))
        acceleration = rate * (rate / 4.0 * (amplitude - state.amplitude) - state.amplitude_rate)
        speed = state.amplitude_rate + dt * acceleration
        return OscillatorState(
            has_begun=xp.ones_like(state.has_begun),
            clock=state.clock + dt * turn,
            phase=phase + dt * change,
            amplitude=state.amplitude + dt * speed,
            amplitude_rate=speed,
        )


def _find_parents(joints: Joints) -> Int[np.ndarray, " h"]:
    """Return for each hinge the next one on the way to the head, itself where there is none; each docking has one."""
    pairs = zip(joints.own.tolist(), joints.ahead.tolist(), strict=True)
    fars = [own if joints.parents[own] == ahead else ahead for own, ahead in pairs]
    hinges = {far: hinge for hinge, far in enumerate(fars)}
    return np.array([hinges.get(joints.parents[far], hinge) for hinge, far in enumerate(fars)], dtype=int)
