"""Data and measurements used by the benchmarks: clouds, changes, controllers, the authors' own program."""
