"""What `make check` and `make assets` run besides the packages."""
