"""Limits of the fields of a run's configuration: values outside are meaningless or too large for any machine."""

MAX_SEED = 2**32 - 1
"""What NumPy's `RandomState` takes."""
MAX_MODULES = 50
"""As in the environment."""
MAX_GENERATIONS = 10**9
MAX_GENOTYPES = 100_000
MAX_TRIALS = 10_000
MAX_WORKERS = 10_000
MAX_MAGNITUDE = 1e9
"""Far beyond any useful gene, fitness or weight."""
MIN_POSITIVE = 1e-9
"""Smallest value of what must be above 0: step sizes, shares."""
