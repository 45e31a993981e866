"""What somebody without a glove can try: a simulated hand, and a glove whose hidden effect is to be found."""
