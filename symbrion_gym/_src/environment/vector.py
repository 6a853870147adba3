"""The former name of the environment of many simulations."""

from symbrion_gym._src.environment.organism_vector_env import OrganismVectorEnv

SnakePitVectorEnv = OrganismVectorEnv
