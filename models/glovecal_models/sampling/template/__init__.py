"""A template calibration from hand shapes that everybody can take (Krnoul et al. 2016, section 3.3.4)."""
