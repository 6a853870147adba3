"""The growing grid (GG): growth, learning, the paper's sequential mode, refinement."""
