"""Files: written whole or not at all, read within bounds, checked by type; the user's cache."""
