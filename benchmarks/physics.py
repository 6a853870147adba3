"""Laws of physics: what the simulated robot does against closed-form theory, row by row.

python -m benchmarks.physics [--quick] [--only NAME ...] [--more]

Rows are written one by one; `--more` keeps those of the present code's last run and measures only what is missing.
`python docs/physics_pictures.py` draws them.
"""

import argparse
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.material.physics_bars import find_bars, format_table
from benchmarks.material.physics_energy import (
    measure_creep,
    measure_depths,
    measure_energy,
    measure_sinking,
    measure_twitching,
)
from benchmarks.material.physics_laws import (
    GAP_SPEED,
    TURN_SPEED,
    measure_gap_limit,
    measure_slope_limit,
    measure_step_limit,
    measure_turning_rate,
)
from benchmarks.material.physics_published import (
    DRIVES,
    FRICTION,
    FRICTION_ALONG,
    Drive,
    find_misses,
    measure_drive,
)
from benchmarks.material.physics_theory import (
    find_beam_gap_limit,
    find_gap_limit,
    find_slope_limit,
    find_tipping_limit,
)
from benchmarks.material.physics_wheels import compute_turning_rate, find_step_limit, make_contacts
from benchmarks.material.physics_worlds import World
from benchmarks.report import Results
from symbrion_gym._src.arenas.checks import FRICTION_LIMITS
from symbrion_gym._src.robot.belts import compute_load_gain, compute_sliding_rate
from symbrion_gym._src.robot.scout import CONTACT_TIME, compute_friction_stiffness

FRICTIONS = (0.3, 0.5, 0.7, 0.9)
TORQUES = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0, 6.0, 8.0)
"""Hinge torques of a snake at the gap [N m]."""
Row = tuple[str, Callable[[], dict[str, Any]]]
"""Name of a row of a law, and what measures it."""


def list_slopes() -> Iterator[Row]:
    """Yield slopes climbed by snakes, against atan(friction), and by a lone module, against tipping over."""
    base = World(modules=8)
    for friction in FRICTIONS:
        yield _slope(replace(base, friction=friction))
    yield _slope(base, heading=45.0)
    for timestep in (0.001, 0.01):
        yield _slope(replace(base, timestep=timestep))
    for modules in (1, 2, 4):
        yield _slope(replace(base, modules=modules))


def _slope(world: World, heading: float = 0.0) -> Row:
    def measure() -> dict[str, Any]:
        limits = [find_slope_limit(world.friction)]
        if world.modules == 1:
            limits.append(find_tipping_limit(world.organism.scout))
        theory = float(np.degrees(min(limits)))
        return _compare(measure_slope_limit(world, heading), theory)

    return f"{_name(world)}{_name_scout(world)}, heading {heading:.0f}°", measure


def list_gaps() -> Iterator[Row]:
    """Yield gaps that straight snakes cross, against the statics of the chain, by torque, length, friction, speed."""
    for torque in TORQUES:
        for modules in (4, 6, 8) if torque in (1.0, 2.0, 4.5, 8.0) else (8,):
            yield _gap(World(modules=modules, scout={"hinge_torque": torque}))
    base = World(modules=8, scout={"hinge_torque": 4.5})
    for friction in (0.3, 0.34, 0.4, 0.5, 0.9):
        yield _gap(replace(base, friction=friction))
    for speed in (0.02, 0.1, 0.15):
        yield _gap(base, speed)
    yield _gap(replace(base, timestep=0.001))
    yield _gap(replace(base, scout={"hinge_torque": 4.5, "track_radius": 0.01}))


def _gap(world: World, speed: float = GAP_SPEED) -> Row:
    def measure() -> dict[str, Any]:
        organism = world.organism
        more = {
            "sharp": find_gap_limit(organism, is_round=False),
            "beam": find_beam_gap_limit(organism),
            "torque": organism.scout.hinge_torque,
            "modules": world.modules,
        }
        return _compare(measure_gap_limit(world, speed), find_gap_limit(organism)) | more

    return (
        f"{_name(world)}, torque {world.scout['hinge_torque']} N m{_name_scout(world)}{_name_speed(speed)}",
        measure,
    )


def _name_speed(speed: float) -> str:
    return "" if speed == GAP_SPEED else f", speed {speed} m/s"


_CONSTANTS = {"track_radius": "radius {} m"}
"""Constants of a module that rows vary -> their words."""


def _name_scout(world: World) -> str:
    return "".join(
        f", {words.format(world.scout[name])}" for name, words in _CONSTANTS.items() if name in world.scout
    )


def list_steps() -> Iterator[Row]:
    """Yield steps that a lone module climbs, against the statics of its wheels at the edge."""
    for friction in FRICTIONS:
        yield _step(World(friction=friction))
    yield _step(World(timestep=0.001))


def _step(world: World) -> Row:
    def measure() -> dict[str, Any]:
        return _compare(measure_step_limit(world), find_step_limit(world.organism.scout))

    return f"{_name(world)}{_name_scout(world)}", measure


def list_turns() -> Iterator[Row]:
    """Yield rates of turning on the spot, against points of Coulomb friction that bear what the contacts' law says."""
    for modules in (1, 2, 3, 4):
        yield _turn(World(modules=modules))
    for friction in (0.3, 0.9):
        yield _turn(World(modules=3, friction=friction))
    for modules in (2, 3, 4):
        yield _turn(World(modules=modules, timestep=0.001))
    for modules in (1, 3):
        yield _turn(World(modules=modules), 0.01)


def _turn(world: World, speed: float = TURN_SPEED) -> Row:
    def measure() -> dict[str, Any]:
        contacts = make_contacts(world.organism, speed)
        points, belts = contacts.points, contacts.belts
        rate = compute_sliding_rate(
            contacts,
            compute_load_gain(world.friction, compute_friction_stiffness(world.modules), CONTACT_TIME),
        )
        even = compute_turning_rate(points, np.ones(len(points)), belts)
        corners = np.isin(points[:, 0], (points[:, 0].min(), points[:, 0].max()))
        least = compute_turning_rate(points[corners], np.ones(int(corners.sum())), belts[corners])
        return _compare(measure_turning_rate(world, speed), rate) | {"even": even, "corners": least}

    return f"{_name(world)}{_name_scout(world)}, {speed} m/s", measure


def list_energies() -> Iterator[Row]:
    """Yield energy balances of a snake of 8 that drives up a slope of 10° while a wave runs through its hinges."""
    for timestep in (0.005, 0.001):
        yield _energy(World(modules=8, timestep=timestep))


def _energy(world: World) -> Row:
    def measure() -> dict[str, Any]:
        found = measure_energy(world, np.radians(10.0))
        return {name: float(value) for name, value in found._asdict().items()} | {
            "residual": float(found.residual)
        }

    return _name(world), measure


def list_rests() -> Iterator[Row]:
    """Yield creep of a snake of 8 with its tracks off: hinges still, and hinges twitching in opposite phase."""
    for timestep in (0.005, 0.001):
        world = World(modules=8, timestep=timestep)
        for slope in (0.0, 10.0, 20.0):
            yield _still(world, slope)
    for modules in (1, 2, 4):
        yield _still(World(modules=modules), 20.0)
    world = World(modules=8)
    for height, frequency in ((0.1, 0.5), (0.3, 0.1), (0.3, 0.5), (0.3, 1.0)):
        yield (
            f"twitching, {_name(world)}, {height} rad, {frequency} Hz",
            lambda height=height, frequency=frequency: {
                "per cycle": measure_twitching(world, height, frequency)
            },
        )


def _still(world: World, slope: float) -> Row:
    def measure() -> dict[str, Any]:
        return {"speed": measure_creep(world, np.radians(slope))}

    return f"still, {_name(world)}, slope {slope:.0f}°", measure


def list_touches() -> Iterator[Row]:
    """Yield depths of modules that hinges at full torque press into each other."""
    for modules in (5, 6, 8):
        world = World(modules=modules)
        yield _name(world), lambda world=world: measure_depths(world)._asdict()


def list_sinkings() -> Iterator[Row]:
    """Yield how deep snakes of 8 sink into the course, driven at random, over all frictions that are allowed."""
    for friction in (FRICTION_LIMITS[0], 0.3, 0.7, 1.5, 3.0, FRICTION_LIMITS[1]):
        yield f"friction {friction:g}", lambda friction=friction: measure_sinking(friction)._asdict()


def list_published() -> Iterator[Row]:
    """Yield the drives of a published tracked robot: where they led, and how many figures are not as expected."""
    for friction in (FRICTION, FRICTION_ALONG):
        for name, drive in DRIVES.items():
            yield (
                f"{name}, friction {friction:g}",
                lambda drive=drive, friction=friction: _drive(drive, friction),
            )


def _drive(drive: Drive, friction: float) -> dict[str, Any]:
    found = measure_drive(drive, friction)
    misses = find_misses(drive, found)
    return found | {"misses": len(misses), "missed": misses, "of": len(drive.expected)}


PARTS: dict[str, Callable[[], Iterator[Row]]] = {
    "slope": list_slopes,
    "gap": list_gaps,
    "step": list_steps,
    "turning": list_turns,
    "energy": list_energies,
    "rest": list_rests,
    "touching": list_touches,
    "sinking": list_sinkings,
    "published": list_published,
}


def run(quick: bool = False, only: tuple[str, ...] = (), more: bool = False) -> dict[str, Any]:
    """Measure, print, store and return the rows, and print the table of targets.

    Args:
        quick: only every eighth row of each law.
        only: names of laws; all by default.
        more: keep the rows that are there.
    """
    results = Results("physics")
    for part in only or PARTS:
        found = dict(results.content.get(part, {})) if more else {}
        for name, measure in list(PARTS[part]())[:: 8 if quick else 1]:
            if name in found:
                continue
            start = time.process_time()
            found[name] = measure()
            seconds = time.process_time() - start
            print(f"{part}: {name}: {_format(found[name])} ({seconds:.1f} s)", flush=True)
            results.put(part, found)
    results.put("bars", find_bars(results.content))
    print(format_table(results.content["bars"]))
    return results.content


def _compare(simulated: float, theory: float) -> dict[str, Any]:
    """Return both, and by how much the simulation is off."""
    return {
        "simulated": simulated,
        "theory": theory,
        "off": abs(simulated - theory),
        "off_share": abs(simulated / theory - 1.0),
    }


def _name(world: World) -> str:
    milliseconds = 1000 * world.timestep
    return f"{world.modules} modules, friction {world.friction}, {milliseconds:.0f} ms"


def _format(row: dict[str, Any]) -> str:
    return ", ".join(
        f"{name} {value:.4g}" if isinstance(value, float) else f"{name} {value}"
        for name, value in row.items()
    )


def main() -> None:
    """Read the command line and run."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.physics",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--quick", action="store_true", help="every eighth row")
    parser.add_argument("--only", nargs="*", default=[], choices=list(PARTS), help="laws (default: all)")
    parser.add_argument("--more", action="store_true", help="keep the rows that are there")
    options = parser.parse_args()
    run(options.quick, tuple(options.only), options.more)


if __name__ == "__main__":
    main()
