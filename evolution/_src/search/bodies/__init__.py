"""Search for bodies of docked modules, each of which learns its controller."""
