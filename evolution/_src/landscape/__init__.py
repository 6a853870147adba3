"""The landscape of bodies: what every small body can learn in three tasks, as a table, and searches replayed on it."""
