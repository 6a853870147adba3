"""What is known besides shape: friction from slip, and what new readings say about old ones."""
