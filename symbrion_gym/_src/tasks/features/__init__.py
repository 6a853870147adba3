"""What a task finds on a surface by itself: the way across it, gaps, steps, stairs and ramps."""
