"""Where a body can drive in an arena: layers of ground under ceilings, a map of them, and routes on it."""
