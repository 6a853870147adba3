"""The figures that the paper reports (SYMBRION, 2011)."""

NETWORK_SECONDS: dict[str, tuple[int, float | None]] = {
    "gsrm_2200": (4175, 20.0),
    "gg_13860": (13860, 270.0),
    "simple": (39, None),
}
"""Table I: model -> triangles and computing time [s]; None for the hand-made model."""
PHYSICS = {"physics_us": "147-152", "collision_us": "825-846"}
"""Table II: physics step and collision detection [µs], the same for GG, GSRM and the hand-made model."""
PHYSICS_ARENAS = ("gg", "gsrm", "simple")
"""The arenas of Table II."""
SCANS = {"gg": (13860, 362_000.0), "gsrm": (4175, 119_000.0), "simple": (39, 5450.0)}
"""Table III: arena -> triangles and time of one laser scan [µs]."""
SCAN_RATIOS = {"gg": 66, "gsrm": 22, "simple": 1}
"""Table III: arena -> time of one laser scan, relative to the hand-made model."""
