"""An arena for other simulators and robots: MJCF, URDF, USD and OBJ, one file per format."""
