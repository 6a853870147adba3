"""From a surface to convex pieces: repair, closing, cutting, decomposition."""
