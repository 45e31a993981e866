"""What a page shows of a camera before the colour glove."""
