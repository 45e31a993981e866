"""The ``glovecal`` command: one file per verb or noun, all speaking REST."""
