"""Physical effects: the catalogue, what a model is missing, adding and removing them."""
