"""The ways a caller of this package can be wrong."""


class ArenaError(ValueError):
    """An arena cannot be built, found or loaded; the message names the value and a remedy."""


class OrganismError(ValueError):
    """A body breaks the rules of docking; the message names the module or dock and a remedy."""
