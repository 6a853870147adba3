"""Search for bodies: what each learns within a lifetime, algorithms that propose bodies, the record of a run."""
