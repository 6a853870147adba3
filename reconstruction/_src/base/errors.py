"""The ways a caller of this package can be wrong."""


class ReconstructionPackageError(Exception):
    """Base of every error that this package raises on purpose."""


class ScanError(ReconstructionPackageError, ValueError):
    """A scan or point file cannot be used; the message names the file (or array), the reason and a remedy."""


class ReconstructionError(ReconstructionPackageError, ValueError):
    """A surface cannot be reconstructed from what was given; the message names the value and a remedy."""
