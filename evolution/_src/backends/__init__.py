"""Trials of genotypes on threads of this process, worker processes or a Ray cluster; all with equal results."""
