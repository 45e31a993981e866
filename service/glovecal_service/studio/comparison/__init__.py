"""The parts of the Compare page: models and takes, errors as heat, an angle's terms, a replayed hand."""
