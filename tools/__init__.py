"""What `make check` runs besides ruff and pyright."""
