"""Many robots in one arena: docks, signals, two levels of physics, the environment of the swarm."""
