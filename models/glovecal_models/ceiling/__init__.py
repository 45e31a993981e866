"""Whether anything is left to gain from what was recorded: boosted trees on a model's held-out errors."""
