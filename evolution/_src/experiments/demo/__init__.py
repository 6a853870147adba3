"""The demo: from a survey to a champion and its report."""
