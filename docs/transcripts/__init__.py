"""What the pages show as printed is taken from a run: ``python3 do.py docs --write`` (or ``--compare``)."""
