"""Terrain to drive on: what an arena is, where it comes from, how it is kept."""
