"""Planes, boxes, spheres and cylinders in place of the triangles that they fit."""
