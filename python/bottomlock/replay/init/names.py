"""Which quantity a column holds, by its name: the names that loggers, drivers and autopilots use."""

import re
from dataclasses import dataclass

FORCE, OMEGA, FIELD = "force", "omega", "field"
VELOCITY_INCREMENT, ANGLE_INCREMENT = "velocity increment", "angle increment"
VELOCITY, POSITION = "velocity", "position"

_BASES = {
    FORCE: "acc accel acceleration accelerometer accelerations linearacceleration linacc linaccel linearaccel "
    "specificforce force forces f a sf accl fb ab accbody bodyaccel rawacc rawaccel accraw fibb aib accelerationbody",
    OMEGA: "gyr gyro gyroscope gyros omega w g rate rates angularrate angularvelocity angularvel angvel angvelocity "
    "angrate rotationrate rotrate turnrate wb gb bodyrate rawgyro gyroraw gyrobody omegabody gyrorate ars wibb",
    FIELD: "mag magnetometer magneticfield magfield m b field magnetic rawmag magraw compass",
    VELOCITY_INCREMENT: "dvel deltav deltavel deltavelocity dv velocityincrement velinc deltavelo",
    ANGLE_INCREMENT: "dtheta deltatheta deltaangle dang deltaang angleincrement anginc dalpha deltaa",
    VELOCITY: "v vel velocity dvl dvlv dvlvel dvlvelocity bottomvelocity velbody vb bodyvelocity bt vbt btvel speed "
    "linearvelocity velocitybody twistlinear twisttwistlinear instrument velocityinst",
    POSITION: "pos position p poseposition poseposeposition location",
}
_OF_BASE = {base: quantity for quantity, bases in _BASES.items() for base in bases.split()}
_WHOLE = {
    "roll": "roll phi rollangle eulerx rpyx eulerroll attituderoll theta0 gammaroll rot0 rolldeg attroll",
    "pitch": "pitch theta pitchangle eulery rpyy eulerpitch attitudepitch theta1 attpitch",
    "yaw": "yaw psi heading hdg azimuth yawangle eulerz rpyz euleryaw attitudeyaw theta2 course compassheading head "
    "headingtrue trueheading attyaw hdt",
    "depth": "depth depthm vehicledepth tiefe waterdepth depthsensor depthbelowsurface relativedepth data",
    "pressure": "pressure press pabs absolutepressure waterpressure fluidpressure pressureabs baropressure prs",
    "latitude": "lat latitude gpslat latdeg positionlat",
    "longitude": "lon lng long longitude gpslon gpslng londeg positionlon",
    "height": "height alt altitude ellipsoidalheight elevation hgt",
    "north": "n north northing posn posnorth positionnorth northm xnorth ned0 localnorth",
    "east": "e east easting pose poseast positioneast eastm yeast ned1 localeast",
    "down": "d down posd posdown positiondown downm zdown ned2 localdown",
    "velocity_north": "vn vnorth velocitynorth veln velnorth northvelocity vnmps",
    "velocity_east": "ve veast velocityeast vele veleast eastvelocity",
    "velocity_down": "vd vdown velocitydown veld veldown downvelocity",
    "interval": "dt interval deltat timestep",
    "valid": "valid velocityvalid velvalid dvlvalid instrumentvalid velocityinstflag",
    "surge": "surge u vforward velocityforward",
    "sway": "sway vright velocityright vstarboard",
    "heave": "heave vheave velocityheave",
    "rollrate": "rollrate p rollspeed", "pitchrate": "pitchrate q pitchspeed", "yawrate": "yawrate r yawspeed",
}  # fmt: skip
_OF_WHOLE = {name: quantity for quantity, names in _WHOLE.items() for name in names.split()}
_TIME = {
    "time", "t", "timestamp", "stamp", "timestamps", "sec", "seconds", "secs", "s", "times", "tsec", "utc",
    "datetime", "epoch", "clock", "timeutc", "unixtime", "headerstamp", "rostime", "hosttime", "timens",
    "timeus", "timems", "timesec", "ts", "elapsed", "elapsedtime", "gpstime", "tow", "systime", "localtime",
    "timeofvalidity", "date", "recordtime", "logtime", "timesinceboot", "timebootms",
}  # fmt: skip
_TIME_UNITS = {"ns": "ns", "nsec": "ns", "nanoseconds": "ns", "us": "us", "usec": "us", "µs": "us",
               "microseconds": "us", "ms": "ms", "msec": "ms", "milliseconds": "ms", "s": "s", "sec": "s",
               "secs": "s", "seconds": "s"}  # fmt: skip
_PREFIXES = (
    "field", "header", "imu", "ins", "ahrs", "sensor", "msg", "value", "vehicle", "auv", "rov", "raw", "body", "nav",
    "data", "meas", "measured", "ref", "reference", "gt", "truth", "true", "est", "message", "filter", "mti", "vn100",
    "gps", "gnss", "attitude", "odom", "odometry", "pose", "twist", "vector", "state", "run0", "phins", "xsens",
)  # fmt: skip
_AXES = {"x": 0, "y": 1, "z": 2}
_QUATERNION = re.compile(r"^(?:q|quat|quaternion|orientation|attitude|att|rot|rotation)(w|x|y|z|0|1|2|3)$")


@dataclass(frozen=True)
class Named:
    """What a column's name says: quantity, component (of a quaternion 0 is w), unit as written."""

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
        "_msec": "ms", "_sec": "s", "_ns": "ns", "_us": "us", "_ms": "ms", "_s": "s", "_g": "g",
    }  # fmt: skip
    lower = name.lower()
    for ending, unit in ends.items():
        if lower.endswith(ending) and len(lower) > len(ending):
            return name[: -len(ending)], unit
    found = re.fullmatch(r"(?i)(time(?:stamp)?|t)(ns|us|ms)", name)
    return (found[1], found[2].lower()) if found else (name, "")


def time_unit(name: str, unit: str = "") -> str | None:
    """The unit of a column of times as its name states it; "" for one without unit, None for another quantity.

    >>> [time_unit(name) for name in ("TimeUS", "t", "timestamp [ms]", "%time", "acc_x")]
    ['us', '', 'ms', '', None]
    """
    bare, own = split_unit(name)
    tokens = [token for token in re.split(r"[^a-z0-9]+", bare.lower()) if token]
    while tokens:
        if "".join(tokens) in _TIME:
            return _TIME_UNITS.get((own or unit).lower(), "")
        if tokens[0] not in _PREFIXES:
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

    >>> named("linear_acceleration.x"), named("GyrZ"), named("Roll [deg]")
    (Named(quantity='force', component=0, unit=''), Named(quantity='omega', component=2, unit=''), \
Named(quantity='roll', component=0, unit='deg'))
    """
    bare, own = split_unit(name)
    unit = own or unit
    words = re.sub(r"([a-z])([A-Z])", r"\1 \2", bare)
    tokens = [token for token in re.split(r"[^A-Za-z0-9]+", words.lower()) if token]
    while tokens:
        found = _by_tokens(tokens, unit)
        if found is not None:
            return found
        if tokens[0] not in _PREFIXES:
            return None
        tokens = tokens[1:]
    return None


def _by_tokens(tokens: list[str], unit: str) -> Named | None:
    whole = "".join(tokens)
    if whole in _OF_WHOLE:
        return Named(_OF_WHOLE[whole], 0, unit)
    quaternion = _QUATERNION.match(whole)
    if quaternion:
        return Named(
            "quaternion", "wxyz".find(quaternion[1]) if quaternion[1] in "wxyz" else int(quaternion[1]), unit
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
