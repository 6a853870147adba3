"""Private: what binds us is what the package itself names."""
