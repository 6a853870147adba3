"""The former name of the environment of one organism."""

from symbrion_gym._src.environment.organism_env import OrganismEnv

SnakePitEnv = OrganismEnv
