"""LucidGloves: text lines of a home-made flex glove, in the alpha encoding and the older one."""
