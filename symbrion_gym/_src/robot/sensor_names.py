"""The names of the parts of an observation."""

SENSORS = (
    "hinge_angle",
    "hinge_rate",
    "pitch",
    "roll",
    "acceleration",
    "ir",
    "contact",
    "previous_action",
    "hinge_target",
    "dock_force",
    "odometry",
    "track_odometry",
    "laser",
    "goal",
    "goal_direction",
)
DEFAULT_SENSORS = SENSORS[:8]
