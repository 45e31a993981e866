"""The people who wear gloves: ``glovecal subject``."""
