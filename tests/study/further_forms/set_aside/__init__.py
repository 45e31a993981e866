"""Forms by an author who saw neither the diagnosis nor any other form; nobody has looked at them while the
diagnosis was built (``tests/study/set_aside_forms.sha256``)."""
