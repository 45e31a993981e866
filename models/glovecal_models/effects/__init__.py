"""Physical effects that make a glove's readings miss the measured angle."""
