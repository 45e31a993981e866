"""What a glove sends now, beside its hand: angles as a list, readings as strips over the last seconds."""
