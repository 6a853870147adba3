"""Scout modules and the organisms they dock into."""
