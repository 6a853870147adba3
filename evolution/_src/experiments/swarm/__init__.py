"""`symbrion swarm`: single robots gather, dock, cross a pit as one body, and part."""
