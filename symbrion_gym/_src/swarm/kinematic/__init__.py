"""Many robots with simple motion: skid-steering on the height of the surface."""
