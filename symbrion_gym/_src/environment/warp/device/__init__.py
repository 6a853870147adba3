"""Whole environments on a device: terms, observations, rewards and resets in JAX, around the physics of Warp.

JAX is imported at the top of these modules; they are imported where `array="jax"` or "torch" asks for them.
"""
