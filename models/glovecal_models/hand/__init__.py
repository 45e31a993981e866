"""The hand as kinematic chains (Wang & Neff 2013, section 3.2): angles in, places of joints and tips out."""
