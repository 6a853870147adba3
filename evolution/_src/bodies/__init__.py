"""Bodies that evolve: genomes of trees of modules, how they vary, all small ones, pictures."""
