"""Champions after a run: judged, replayed, used as a policy."""
