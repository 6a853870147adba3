"""From a surface to convex pieces: planes, slabs, decomposition, and how far the pieces are off."""
