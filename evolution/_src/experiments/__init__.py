"""Experiments on the whole pipeline: the demo and the paper's. Nothing in the search imports them."""
