"""Champions after a run: judged, played back, used as a policy."""
