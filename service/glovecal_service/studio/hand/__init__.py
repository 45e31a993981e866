"""The hand in three dimensions: skeleton, turning, ghosts, the uncertainty of each joint."""
