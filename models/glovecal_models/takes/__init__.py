"""Takes: continuous recordings inside one wearing, with the reference angles that were measured."""
