"""The ways a caller of this package can be wrong."""


class ScanError(ValueError):
    """A scan or point file cannot be used; the message names the file (or array), the reason and a remedy."""


class ReconstructionError(ValueError):
    """A surface cannot be reconstructed from what was given; the message names the value and a remedy."""
