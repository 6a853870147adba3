"""What robots tell each other: beacons and messages of docks by infrared, and messages by wire within organisms."""
