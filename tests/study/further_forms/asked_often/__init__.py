"""Forms that were set aside until 2026-11-28, and asked by several states of the diagnosis.

Here those that an author who saw no other form expects to meet most often; in ``unlike`` those of another.
"""
