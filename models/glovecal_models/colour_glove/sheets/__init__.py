"""What a person prints for the colour glove: the glove itself, its colours, the camera's board. All in mm."""
