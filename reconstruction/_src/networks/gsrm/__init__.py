"""The growing self-reconstruction map (GSRM): growth, topology, the paper's sequential mode, refinement."""
