"""The Glovecal service: store, training, real-time prediction, REST and the ``glovecal`` command."""
