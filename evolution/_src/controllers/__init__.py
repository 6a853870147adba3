"""Control laws: from genotypes and sensor readings to hinge targets and track speeds."""
