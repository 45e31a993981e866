"""Active sampling: which pose or motion teaches most next (the third limit in Wang & Neff 2013, section 9).

A Gaussian process' variance depends on where it was sampled and not on what was measured there, so what a
step would teach is known before it is recorded (Cohn 1996; Seo et al. 2000 call the criterion ALC).
"""
