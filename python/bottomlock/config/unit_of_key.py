"""The unit that the name of a key ends in."""

_UNITS = (
    ("_percent_of_range", "% of range"),
    ("_deg_per_s_per_rt_s", "deg/s/√s"), ("_percent_per_rt_s", "%/√s"), ("_mps2_per_rt_s", "m/s²/√s"),
    ("_mps_per_rt_s", "m/s/√s"), ("_mps_per_rt_h", "m/s/√h"), ("_deg_per_rt_h", "deg/√h"), ("_deg_per_h", "deg/h"),
    ("_deg_per_s", "deg/s"), ("_kg_per_m3", "kg/m³"), ("_m2ps2", "m²/s²"), ("_percent", "%"), ("_mps2", "m/s²"),
    ("_mps", "m/s"), ("_mrad", "mrad"), ("_ppm", "ppm"),
    ("_deg", "deg"), ("_mg", "mg"), ("_hz", "Hz"), ("_pa", "Pa"), ("_s", "s"), ("_m", "m"),
)  # fmt: skip


def unit_of(key: str) -> str:
    """The unit that a key's name ends in, "" for none.

    >>> unit_of("gyro_bias_deg_per_h")
    'deg/h'
    """
    return next((unit for ending, unit in _UNITS if key.endswith(ending)), "")
