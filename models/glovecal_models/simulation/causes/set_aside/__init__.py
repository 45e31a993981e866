"""Forms that nobody looked at while the diagnosis was built (``tests/study/set_aside_forms.sha256``)."""
