"""The colour glove (Wang & Popovic 2009): a printed pattern, a camera, the hand's pose in each picture."""
