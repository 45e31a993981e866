"""What a diagnosis found, drawn: the one picture of an effect, and errors beside those of controls."""
