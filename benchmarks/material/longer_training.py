"""The champions of searches beyond the map train on, under harder conditions than those under which they are judged."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import evolution as ev
from benchmarks.material.beyond import Found, Place, evolve_for, make_search, make_training
from evolution._src.backends.trials import Randomization
from evolution._src.bodies.genome import parse_genome

TIMES = 2.0
"""Longest training in units of the time of the search for the body."""
HARDER = Randomization(friction=(0.45, 0.9), torque_scale=(0.85, 1.1), yaw=(-0.12, 0.12))
"""A scan is rounder than its place: so there is less friction, hinges are weaker, the scan is stretched."""


def restore_champion(place: Place, arena: str, row: Mapping[str, Any]) -> ev.Champion:
    """Return the champion that a row of the results tells of.

    Args:
        place: where its body was searched.
        arena: the scanned arena.
        row: with `seed`, `genome` and `body_genes`, which may be in any order.
    """
    search = make_search(place, arena, row["seed"])
    organism = search.make_organism(parse_genome(row["genome"]))
    names = search.control.make_controller(organism, search.episode).parameters
    return ev.Champion(
        genotype=tuple(row["body_genes"][name] for name in names),
        names=names,
        arena=arena,
        generation=0,
        fitness=0.0,
        modules=organism,
        episode=search.episode,
        control=search.control,
    )


def train_longer(place: Place, arena: str, row: Mapping[str, Any]) -> Found:
    """Let a champion learn on until it is confirmed under harder conditions, or the time is spent.

    A genotype has one trial on each stretch of the scan.
    """
    search = replace(make_search(place, arena, row["seed"]), randomization=HARDER)
    training = make_training(search, restore_champion(place, arena, row))
    training = replace(training, search=replace(training.search, trials=len(HARDER.stretch)))
    return evolve_for(training, TIMES * place.seconds)
