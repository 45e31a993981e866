"""From label images to the hand's pose, stage by stage, with what is known of its error."""
