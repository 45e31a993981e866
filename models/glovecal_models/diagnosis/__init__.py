"""Which physical effect is missing: ranked evidence on takes left out of each fit."""
