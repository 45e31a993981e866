"""The recorder process: every frame of a recording on disk, accounted for, and guided samplings."""
