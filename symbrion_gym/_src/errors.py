"""The ways a caller of this package can be wrong."""


class SymbrionGymError(Exception):
    """The base class of this package's errors."""


class ArenaError(SymbrionGymError, ValueError):
    """An arena cannot be built, found or loaded; the message names the value and a remedy."""


class OrganismError(SymbrionGymError, ValueError):
    """An organism breaks the rules of docking; the message names the module or dock and a remedy."""


class OptionError(SymbrionGymError, ValueError):
    """An option of an environment is unknown or out of range; the message names the value and what is allowed."""


class SurveyError(ArenaError):
    """A survey, its robot or a scanner cannot be set up; the message names the value and a remedy."""


class TaskError(SymbrionGymError, ValueError):
    """A task is unknown, impossible in an arena or cannot be restored; the message gives the reason and a remedy."""
