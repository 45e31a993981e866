"""What a glove sends now, beside its hand: angles as a list, one of them term by term, readings as strips."""
