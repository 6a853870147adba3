"""What new readings say about a known surface: what is free, what has changed."""
