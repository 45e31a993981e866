"""What the examples share: the hand from the pose stream, a simulated hand, drawings and the live page."""
