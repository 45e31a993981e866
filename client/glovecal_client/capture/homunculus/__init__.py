"""LeRobot Homunculus: lines of sixteen numbers."""
