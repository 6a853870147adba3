"""Known objects: instances of a mesh found in a scan, with pose, score and coverage."""
