"""Friction of the ground from the slip of robots: readings, friction by place, patches."""
