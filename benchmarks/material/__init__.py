"""What the benchmarks measure on and against: clouds and the authors' own program."""
