"""What an organism has to do: route, pit, success check, and the audit of a success."""
