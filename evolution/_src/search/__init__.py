"""The search: CMA-ES, the loop, validation, records, and runs that can be resumed."""
