"""Whether anything is left to gain from what was recorded: a black box on a model's held-out errors."""
