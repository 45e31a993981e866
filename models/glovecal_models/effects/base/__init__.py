"""What every effect answers, and the kinds of effect there are: the machinery behind the catalogue."""
