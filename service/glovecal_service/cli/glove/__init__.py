"""Gloves: layouts, capture, live poses and recordings."""
