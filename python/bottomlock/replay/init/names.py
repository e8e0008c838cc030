"""Which quantity a column holds, by its name: a short table, within the prefixes of a message or a sensor."""

import re
from dataclasses import dataclass

FORCE, OMEGA = "force", "omega"
VELOCITY_INCREMENT, ANGLE_INCREMENT = "velocity increment", "angle increment"
VELOCITY = "velocity"
QUATERNION, NUMBERED = "quaternion", "numbered quaternion"
"""Of letters, w x y z, and of numbers, which say no order: 0 is the scalar in the literature, of 1 to 4 the first or
the last."""

_BASES = {
    FORCE: "acc accel accelerometer acceleration linearacceleration specificforce force f a",
    OMEGA: "gyr gyro gyroscope omega angularrate angularvelocity w g",
    VELOCITY_INCREMENT: "dvel deltav deltavelocity",
    ANGLE_INCREMENT: "dtheta deltatheta deltaangle",
    VELOCITY: "v vel velocity dvl linearvelocity twistlinear instrument velocityinst",
}
_OF_BASE = {base: quantity for quantity, bases in _BASES.items() for base in bases.split()}
_WHOLE = {
    "roll": "roll phi theta0 rollen roulis",
    "pitch": "pitch theta theta1 nicken tangage",
    "yaw": "yaw heading hdg psi theta2 cap",
    "depth": "depth data tiefe profondeur profundidad",
    "pressure": "pressure press",
    "latitude": "latitude lat",
    "longitude": "longitude lon lng long",
    "height": "height altitude alt",
    "north": "north northing n",
    "east": "east easting e",
    "down": "down d",
    "velocity_north": "vn vnorth velocitynorth",
    "velocity_east": "ve veast velocityeast",
    "velocity_down": "vd vdown velocitydown",
    "interval": "dt interval deltat",
    "valid": "valid velocityvalid instrumentvalid velocityinstflag",
    "surge": "surge u",
    "sway": "sway v",
    "heave": "heave w",
    "rollrate": "rollrate p",
    "pitchrate": "pitchrate q",
    "yawrate": "yawrate r",
}
_OF_WHOLE = {name: quantity for quantity, names in _WHOLE.items() for name in names.split()}
_TIME = {"time", "t", "timestamp", "stamp", "headerstamp", "sec", "seconds", "s", "utc", "datetime", "date", "epoch",
         "unixtime", "timeboot", "zeit", "temps", "tiempo"}  # fmt: skip
_TIME_UNITS = {"ns": "ns", "nsec": "ns", "nanoseconds": "ns", "us": "us", "usec": "us", "µs": "us",
               "microseconds": "us", "ms": "ms", "msec": "ms", "milliseconds": "ms", "s": "s", "sec": "s",
               "secs": "s", "seconds": "s"}  # fmt: skip
_PREFIXES = ("field", "header", "imu", "ins", "ahrs", "gps", "sensor", "vehicle", "body", "nav", "raw", "ref",
             "truth", "odom", "pose", "twist", "attitude")  # fmt: skip
_AXES = {"x": 0, "y": 1, "z": 2}
_SPELLINGS = {
    spelling: unit
    for unit, spellings in {
        "m": "meter meters metre metres", "ft": "feet foot", "m/s": "mps m/sec", "kn": "knots knot kts kt",
        "km/h": "kph kmh", "ft/s": "fps feet/s ft/sec", "rad": "radian radians", "deg": "° degree degrees",
        "rad/s": "rps rad/sec radians/s radians/sec", "deg/s": "dps °/s °/sec deg/sec degrees/s degrees/sec",
        "deg/h": "°/h deg/hr degrees/h degrees/hr", "Pa": "pa", "kPa": "kpa", "mbar": "hpa",
    }.items()
    for spelling in spellings.split()
}  # fmt: skip
_QUATERNION = re.compile(r"^(?:q|quat|quaternion|orientation|attitude|att|rot|rotation)(w|x|y|z|[0-4])$")


@dataclass(frozen=True)
class Named:
    """What a column's name says: quantity, component (of a quaternion of letters 0 is w), unit as written."""

    quantity: str
    component: int = 0
    unit: str = ""


def split_unit(name: str) -> tuple[str, str]:
    """A name and the unit in brackets or at its end.

    >>> split_unit("DVL X [m/s]"), split_unit("acc_x (g)"), split_unit("omega_x_radps"), split_unit("TimeUS")
    (('DVL X', 'm/s'), ('acc_x', 'g'), ('omega_x', 'rad/s'), ('Time', 'us'))
    """
    found = re.search(r"\s*[\[(]([^\])]*[A-Za-z°µ%][^\])]*)[\])]\s*$", name)
    if found:
        return name[: found.start()].strip(), found[1].strip()
    ends = {
        "_mps2": "m/s2", "_m_s2": "m/s2", "_ms2": "m/s2", "_radps": "rad/s", "_rad_s": "rad/s",
        "_rads": "rad/s", "_degps": "deg/s", "_deg_s": "deg/s", "_dps": "deg/s", "_mmps": "mm/s", "_cmps": "cm/s",
        "_mps": "m/s", "_m_s": "m/s", "_mm_s": "mm/s",
        "_cm_s": "cm/s", "_rad": "rad", "_deg": "deg", "_mg": "mg", "_dbar": "dbar", "_mbar": "mbar", "_kpa": "kPa",
        "_hpa": "mbar", "_bar": "bar", "_pa": "Pa", "_cm": "cm", "_m": "m", "_nsec": "ns", "_usec": "us",
        "_msec": "ms", "_sec": "s", "_ns": "ns", "_us": "us", "_ms": "ms", "_s": "s", "_g": "g", "_kn": "kn",
        "_kts": "kn", "_kmh": "km/h", "_fps": "ft/s", "_ft": "ft",
    }  # fmt: skip
    lower = name.lower()
    for ending, unit in ends.items():
        if lower.endswith(ending) and len(lower) > len(ending):
            return name[: -len(ending)], unit
    found = re.fullmatch(r"(?i)(time(?:stamp)?|t)(ns|us|ms)", name)
    return (found[1], found[2].lower()) if found else (name, "")


def usual_unit(unit: str) -> str:
    """A unit as a case writes it, of one in another spelling.

    >>> [usual_unit(one) for one in ("Knots", "°/s", "kPa", "CM/S", "m / s")]
    ['kn', 'deg/s', 'kPa', 'cm/s', 'm/s']
    """
    bare = unit.lower().replace(" ", "")
    return _SPELLINGS.get(bare, bare)


def time_unit(name: str, unit: str = "") -> str | None:
    """The unit of a column of times as its name states it; "" for one without unit, None for another quantity.

    >>> [time_unit(name) for name in ("TimeUS", "t", "time_boot_ms", "timestamp [ms]", "%time", "acc_x")]
    ['us', '', 'ms', 'ms', '', None]
    >>> time_unit("/dvl/header/stamp"), time_unit("dvl_stamp")
    ('', None)
    """
    bare, own = split_unit(name)
    tokens = [token for token in re.split(r"[^a-z0-9]+", bare.lower()) if token]
    while tokens:
        if "".join(tokens) in _TIME:
            return _TIME_UNITS.get((own or unit).lower(), "")
        # A topic has names of its own before that of the field.
        if tokens[0] not in _PREFIXES and not name.startswith("/"):
            return None
        tokens = tokens[1:]
    return None


def seconds_and_nanoseconds(names: list[str]) -> tuple[str, str] | None:
    """Two columns that are together one time: whole seconds and nanoseconds, as ROS writes a stamp.

    >>> seconds_and_nanoseconds(["header.stamp.sec", "header.stamp.nanosec", "x"])
    ('header.stamp.sec', 'header.stamp.nanosec')
    """
    by = {re.sub(r"[^a-z]", "", name.lower()): name for name in names}
    for whole, part in (("sec", "nanosec"), ("secs", "nsecs"), ("sec", "nsec")):
        for key, name in by.items():
            other = key[: -len(whole)] + part
            stamp = key.endswith("stamp" + whole) or key == whole
            if stamp and other in by and by[other] != name:
                return name, by[other]
    return None


def named(name: str, unit: str = "") -> Named | None:
    """What a column holds by its name; None where the name is not a known one.

    >>> named("/imu/data/linear_acceleration/y").component
    1
    >>> named("linear_acceleration.x"), named("GyrZ"), named("Roll [deg]")
    (Named(quantity='force', component=0, unit=''), Named(quantity='omega', component=2, unit=''), \
Named(quantity='roll', component=0, unit='deg'))
    """
    bare, own = split_unit(name)
    unit = usual_unit(own or unit)
    words = re.sub(r"([a-z])([A-Z])", r"\1 \2", bare)
    tokens = [token for token in re.split(r"[^a-z0-9]+", words.lower()) if token]
    while tokens:
        found = _by_tokens(tokens, unit)
        if found is not None:
            return found
        if tokens[0] not in _PREFIXES and not name.startswith("/"):
            return None
        tokens = tokens[1:]
    return None


def _by_tokens(tokens: list[str], unit: str) -> Named | None:
    whole = "".join(tokens)
    if whole in _OF_WHOLE:
        return Named(_OF_WHOLE[whole], 0, unit)
    quaternion = _QUATERNION.match(whole)
    if quaternion:
        letter = quaternion[1] in "wxyz"
        return Named(
            QUATERNION if letter else NUMBERED,
            "wxyz".find(quaternion[1]) if letter else int(quaternion[1]),
            unit,
        )
    if tokens[0] in _AXES and len(tokens) > 1:
        tokens = [*tokens[1:], tokens[0]]
        whole = "".join(tokens)
    base, last = whole[:-1], whole[-1:]
    if base in _OF_BASE and last in _AXES:
        return Named(_OF_BASE[base], _AXES[last], unit)
    if base in _OF_BASE and last in {"a", "b", "c"} and _OF_BASE[base] == VELOCITY:
        return Named(VELOCITY, "abc".index(last), unit)
    if base in _OF_BASE and last in {"0", "1", "2", "3"} and len(base) > 1:
        return Named(_OF_BASE[base], int(last), unit)
    return None
