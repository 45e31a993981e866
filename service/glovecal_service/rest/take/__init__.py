"""Takes: import, reference angles, clocks, examination, holds: ``/v1/takes``, ``/v1/uploads``."""
