"""What somebody without a glove can try."""
