"""Algorithms that propose bodies, behind one interface."""
