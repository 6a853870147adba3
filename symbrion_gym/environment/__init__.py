"""The Gymnasium environments: episodes, observation, judges, pictures, many at once."""
