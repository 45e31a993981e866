"""What a person with a glove on looks at and listens to: a board with large text, tones, and keys."""
