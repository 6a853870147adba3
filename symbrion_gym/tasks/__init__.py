"""What a body has to do: route, pit, success, and the audit of a success."""
