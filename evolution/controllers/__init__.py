"""Control laws: from genes and readings to targets of the hinges."""
