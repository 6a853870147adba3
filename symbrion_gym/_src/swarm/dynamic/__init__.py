"""Robots in full contact: free ones, latched pairs and organisms in one MuJoCo model."""
