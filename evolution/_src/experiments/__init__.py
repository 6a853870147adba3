"""Experiments on the whole pipeline: trainings, the story of the swarm, the paper. The search imports none of them."""
