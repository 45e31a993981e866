"""How far each rotation of a healthy hand goes of its own strength, in degrees.

Flexion, abduction and the thumb's turn across the palm are positive. Finger, thumb and wrist flexion and
the wrist's radial (positive) and ulnar deviation follow the joint motion tables of the American Academy of
Orthopaedic Surgeons ("Joint Motion: Method of Measuring and Recording", 1965): MCP 0 to 90, PIP 0 to 100,
DIP 0 to 90, thumb MCP 0 to 50, thumb IP 0 to 80, thumb abduction 0 to 70, wrist 70 extension to 80 flexion,
20 radial to 30 ulnar deviation. Those without a row there are typical values: the spread between two
fingers (30, the widest widget of Wang & Neff 2013, section 5.1.2), the thumb's turn and its virtual joint,
the palm arch, and the little overextension most people show at the finger knuckles.
"""

from __future__ import annotations

ACTIVE_RANGE_DEG: dict[str, tuple[float, float]] = {
    "T_TMC": (0.0, 60.0),
    "TI_ABD": (0.0, 70.0),
    "T_VIR": (0.0, 65.0),
    "T_MCP": (0.0, 50.0),
    "T_IP": (0.0, 80.0),
    "I_MCP": (-10.0, 90.0),
    "I_PIP": (0.0, 100.0),
    "I_DIP": (0.0, 90.0),
    "IM_ABD": (0.0, 30.0),
    "M_MCP": (-10.0, 90.0),
    "M_PIP": (0.0, 100.0),
    "M_DIP": (0.0, 90.0),
    "R_MCP": (-10.0, 90.0),
    "R_PIP": (0.0, 100.0),
    "R_DIP": (0.0, 90.0),
    "MR_ABD": (0.0, 30.0),
    "P_MCP": (-10.0, 90.0),
    "P_PIP": (0.0, 100.0),
    "P_DIP": (0.0, 90.0),
    "RP_ABD": (0.0, 30.0),
    "PALM_ARCH": (0.0, 25.0),
    "W_FLEX": (-70.0, 80.0),
    "W_ABD": (-30.0, 20.0),
}
"""Lowest and highest angle of each rotation."""
