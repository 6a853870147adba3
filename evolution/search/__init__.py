"""The search: CMA-ES, its loop, trials, validation, records, runs that resume."""
