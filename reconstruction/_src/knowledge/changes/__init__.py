"""What new readings show about a known surface: what is free, what has changed."""
