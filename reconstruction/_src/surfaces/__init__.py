"""Triangle meshes: topology, two-manifolds, fitting, quality."""
