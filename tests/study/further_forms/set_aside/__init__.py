"""Forms that nobody looked at while the diagnosis was built (``tests/study/set_aside_forms.sha256``).

Here those that an author who saw no other form expects to meet most often; in ``unlike`` those of another.
"""
