"""`symbrion live`: a robot updates the model of a place that has changed."""
