"""Every figure that the README and the documentation state, and where in `benchmarks/results` it comes from.

One file per benchmark. `python -m benchmarks.table` turns these lists into text; figures are written nowhere else.
"""

from benchmarks.claims.arena import ARENA
from benchmarks.claims.baselines import BASELINES
from benchmarks.claims.beyond import BEYOND
from benchmarks.claims.cheap_trials import CHEAP_TRIALS
from benchmarks.claims.color import COLOR
from benchmarks.claims.environment import ENVIRONMENT
from benchmarks.claims.evolution import EVOLUTION
from benchmarks.claims.folds import FOLDS
from benchmarks.claims.friction import FRICTION
from benchmarks.claims.imports import IMPORTS
from benchmarks.claims.landscape import LANDSCAPE
from benchmarks.claims.limits import LIMITS
from benchmarks.claims.living import LIVING
from benchmarks.claims.objects import OBJECTS
from benchmarks.claims.physics import PHYSICS
from benchmarks.claims.primitives import PRIMITIVES
from benchmarks.claims.real_scans import REAL_SCANS
from benchmarks.claims.reconstruction import RECONSTRUCTION
from benchmarks.claims.refine import REFINE
from benchmarks.claims.scans import SCANS
from benchmarks.claims.searches import SEARCHES
from benchmarks.claims.staircase import STAIRCASE
from benchmarks.claims.swarm import SWARM
from benchmarks.claims.warp import WARP
from benchmarks.figures import Claim

GROUPS: dict[str, tuple[Claim, ...]] = {
    "Scans": SCANS,
    "Reconstruction": RECONSTRUCTION,
    "Folds and self-intersections": FOLDS,
    "Colors": COLOR,
    "Updating a reconstruction after a change": REFINE,
    "Friction of the ground": FRICTION,
    "Places that change": LIVING,
    "Arenas": ARENA,
    "Arenas of other people's scans": REAL_SCANS,
    "Primitives in place of triangles": PRIMITIVES,
    "Known objects": OBJECTS,
    "Environment": ENVIRONMENT,
    "Physics against theory": PHYSICS,
    "MuJoCo Warp against C": WARP,
    "Baselines: no control and random controllers": BASELINES,
    "Evolution": EVOLUTION,
    "Cheaper trials of a search": CHEAP_TRIALS,
    "Searches at an equal budget": SEARCHES,
    "The landscape of bodies": LANDSCAPE,
    **({"Bodies beyond the landscape": BEYOND} if BEYOND else {}),  # once a place is measured whole
    "A real staircase": STAIRCASE,
    "Swarms": SWARM,
    "Startup time": IMPORTS,
}
CLAIMS: tuple[Claim, ...] = tuple(claim for group in GROUPS.values() for claim in group)

__all__ = ["CLAIMS", "GROUPS", "LIMITS"]
