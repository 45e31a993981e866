"""A simulated hand in a simulated glove: motion, sensors and takes whose truth is known."""
