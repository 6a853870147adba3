"""Environments in the form that other libraries call."""
