"""The ``glovecal`` command, all of it speaking REST: a folder per noun, a file per verb."""
