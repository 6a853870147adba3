"""Who tries the genotypes: threads of this process, processes, or a Ray cluster; all with equal results."""
