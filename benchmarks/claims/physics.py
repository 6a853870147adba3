"""Laws of physics: the simulated robot against closed-form theory."""

from benchmarks.figures import MM, PERCENT, Claim, Value

_DEGREES = ("°", "1", 1.0, 2)
_TURN = "Rate of turning on the spot against Coulomb friction, loads by the law of the contacts: "
_STEP = "Highest step of a lone module against the statics of its wheels: "
_SLOPE = "Steepest slope of a snake against atan(friction): "
_CREEP = "Speed of 8 modules with tracks off and hinges still: "
_DEPTH = "Depth of modules that hinges at full torque press into each other: "


def _claim(what: str, bar: str, unit: str, target: str, scale: float = 1.0, digits: int = 1) -> Claim:
    """Return the claim about the worst row of a law; its error, unless the words say otherwise."""
    value = Value("physics", f"bars/{bar}", scale=scale)
    return Claim(what, f"{{0:.{digits}f}} {unit}", (value,), bar=f"<= {target} {unit}" if target else "")


PHYSICS = (
    _claim(
        f"{_SLOPE}spheres, friction 0.3-0.9, 2-8 modules, 1-10 ms; largest error", "slope, spheres", *_DEGREES
    ),
    _claim(f"{_SLOPE}wheels on joints; largest error", "slope, wheels", *_DEGREES),
    _claim(f"{_SLOPE}the authors' cylinders; largest error", "slope, cylinders", *_DEGREES),
    _claim(
        f"{_SLOPE}wheels and cylinders with heavier motors (armature 0.004 kg m²); largest error",
        "slope, steady wheels",
        *_DEGREES,
    ),
    _claim(f"{_SLOPE}diagonal heading, pyramidal contacts; error", "slope, diagonal, pyramidal", *_DEGREES),
    _claim(f"{_SLOPE}diagonal heading, elliptic contacts; error", "slope, diagonal, elliptic", *_DEGREES),
    _claim(
        "Slope on which a lone module tips, against its center of mass; error",
        "slope, lone module",
        *_DEGREES,
    ),
    _claim(
        "Widest gap against the statics of a straight chain: hinges of 2-8 N m, 4-8 modules; largest error",
        *("gap, spheres, 2 to 8 N m", "%", "5", PERCENT),
    ),
    _claim(
        "Widest gap against the statics of a straight chain: all rows, from 0.5 N m; largest error",
        *("gap", "%", "5", PERCENT),
    ),
    _claim(
        "Widest gap against statics of a straight chain: all rows but 3.5 N m, and friction 0.3 with its soft servo",
        *("gap, explained rows apart", "%", "5", PERCENT),
    ),
    _claim(
        "Widest gap against statics of a straight chain: friction 0.3 with its soft servo; error",
        *("gap, friction 0.3", "%", "5", PERCENT),
    ),
    _claim(f"{_STEP}friction 0.5-0.9; largest error", "step, friction 0.5 to 0.9", "%", "10", PERCENT),
    _claim(f"{_STEP}friction 0.3; largest error", "step, friction 0.3", "%", "10", PERCENT),
    _claim(f"{_STEP}the authors' cylinders; largest error", "step, cylinders", "%", "10", PERCENT),
    _claim(f"{_STEP}cylinders as capsules; largest error", "step, capsules", "%", "10", PERCENT),
    _claim(
        f"{_STEP}cylinders as capsules, friction 0.5-0.9, pyramidal contacts; largest error",
        *("step, capsules, friction 0.5 to 0.9, pyramidal", "%", "10", PERCENT),
    ),
    _claim(
        f"{_TURN}2-4 modules on spheres, elliptic contacts, 5 ms; largest error",
        *("turning, 2 to 4 modules, elliptic, 5 ms", "%", "10", PERCENT),
    ),
    _claim(
        f"{_TURN}spheres, elliptic contacts, 1 ms or tracks at 0.01 m/s; largest error",
        *("turning, 2 to 4 modules, elliptic, 1 ms or 0.01 m/s", "%", "10", PERCENT),
    ),
    _claim(
        f"{_TURN}2-4 modules on spheres, pyramidal contacts; largest error",
        *("turning, 2 to 4 modules, pyramidal", "%", "10", PERCENT),
    ),
    _claim(
        f"{_TURN}wheels and cylinders, elliptic contacts; largest error",
        *("turning, elliptic, wheels and cylinders", "%", "10", PERCENT),
    ),
    _claim(
        f"{_TURN}wheels with heavier motors, elliptic contacts; largest error",
        *("turning, steady wheels", "%", "10", PERCENT),
    ),
    _claim(
        f"{_TURN}cylinders with heavier motors, elliptic contacts; largest error",
        *("turning, steady cylinders", "%", "10", PERCENT),
    ),
    _claim(f"{_TURN}a lone module on spheres; largest error", "turning, lone module", "%", "10", PERCENT),
    _claim(
        "Energy of 8 modules on a slope that is not accounted for, as a share of the work done; worst of 8 rows",
        *("energy", "%", "2", PERCENT, 2),
    ),
    _claim(f"{_CREEP}flat ground", "creep on flat ground", "mm/s", "0.1", MM, 3),
    _claim(f"{_CREEP}slopes to 20°, pyramidal contacts", "creep, pyramidal", "mm/s", "0.1", MM, 3),
    _claim(f"{_CREEP}slopes to 20°, elliptic contacts", "creep, elliptic", "mm/s", "0.1", MM, 3),
    _claim(
        "Way moved in a cycle of hinges that twitch in opposite phase, tracks off; worst row",
        *("twitching, pyramidal", "mm", "", MM),
    ),
    _claim(f"{_DEPTH}at rest", "depth between modules", "mm", "1", MM, 2),
    _claim(f"{_DEPTH}at worst while they close", "depth between modules, closing", "mm", "1", MM, 2),
    _claim(
        f"{_DEPTH}at worst while they close, with contact_time 0.004 s and steps of 2 ms",
        *("depth between modules, closing, firm", "mm", "1", MM, 2),
    ),
    _claim(
        "Drives of a published tracked robot (five), most figures of one that are not as expected there: friction 0.7",
        *("published drives, friction 0.7", "figures", "0", 1.0, 0),
    ),
    _claim(
        "Drives of a published tracked robot (five), most figures of one that are not as expected there: friction 150",
        *("published drives, friction 150", "figures", "0", 1.0, 0),
    ),
)
