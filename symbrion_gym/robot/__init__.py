"""Scout modules and the bodies they dock into."""
