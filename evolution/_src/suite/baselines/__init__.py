"""The baselines of the benchmark suite, one file each: what they may use is a `Practice`."""
