"""The true arena of the demo."""

import symbrion_gym as sg


def paint_truth() -> sg.Arena:
    """Return the true arena with colors: the robot's camera sees them, its bodies do not feel them."""
    return sg.Arena.from_course(sg.Course(color_pattern="checker"), "truth")
