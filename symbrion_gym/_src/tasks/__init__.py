"""What an organism has to do: tasks and their terms, routes, and the audit of a success."""
