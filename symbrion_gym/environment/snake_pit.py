"""The former name of the environment of one organism."""

from symbrion_gym.environment.organism_env import OrganismEnv

SnakePitEnv = OrganismEnv
