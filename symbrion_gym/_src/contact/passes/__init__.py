"""The passes that make contact geometry, each a candidate of its own."""
