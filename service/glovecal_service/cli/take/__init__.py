"""Takes: ``glovecal take``, and how other verbs find and import them."""
