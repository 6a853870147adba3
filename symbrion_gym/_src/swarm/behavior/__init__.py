"""What each robot of a swarm does: a finite state machine over what it senses, for all robots at once."""
