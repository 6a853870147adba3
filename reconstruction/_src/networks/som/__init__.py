"""What both networks share: the search of winners, density of samples, padding, compilation."""
