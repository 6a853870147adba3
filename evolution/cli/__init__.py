"""The command `symbrion`."""
