"""Results for people: figures, video, and self-contained HTML pages."""
