"""LeRobot's side of an arm: names and units of its features, and recordings as its datasets. LeRobot is not needed."""
