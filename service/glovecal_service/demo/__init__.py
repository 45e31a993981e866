"""The demo: the product's own parts calibrate a simulated glove, and show what it came to."""
