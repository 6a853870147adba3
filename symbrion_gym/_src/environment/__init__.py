"""The Gymnasium environments: episodes, observation, images, one simulation and many at once."""
