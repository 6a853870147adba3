"""Geometry that every other folder builds on: poses, boxes, rows, orientation, manifolds, heights, hulls."""
