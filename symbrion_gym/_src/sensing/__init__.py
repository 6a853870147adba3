"""Ray casting and what is built on it: range finders, the scanning robot, and the timers."""
