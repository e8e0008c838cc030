"""Commented configurations for a named instrument and autopilot: what `bottomlock live --init` and its page write."""

import json
from dataclasses import dataclass
from typing import Any, Literal, TypeVar

from bottomlock.errors import ScenarioError
from bottomlock.kernel import RECOMMENDED_METHOD
from bottomlock.text import did_you_mean

Mode = Literal["velocity", "navigation"]
_T = TypeVar("_T")


@dataclass(frozen=True)
class Instrument:
    """A DVL as it comes: title, format, address, geometry (a name or a file to make), least rate, cautious noise."""

    title: str
    format: str
    address: str
    geometry: str
    rate_hz: float
    beam_noise_mps: float = 0.05
    notes: tuple[str, ...] = ()
    beams: int = 4


@dataclass(frozen=True)
class Autopilot:
    """A receiver: title, port and where that sends, the mode that it needs, notes, where its IMU is read.

    `settings` is a further line of the port; `asked`, whether the IMU's messages are requested.
    """

    title: str
    port: str
    to: str
    mode: Mode
    notes: tuple[str, ...] = ()
    imu: str = ""
    settings: str = ""
    asked: bool = False


_OWN_GEOMETRY = "geometry.toml holds tilts and azimuths of your instrument: docs/formats.md shows one"
INSTRUMENTS = {
    "a50": Instrument(
        "Water Linked A50 or A125, TCP", "waterlinked-json", "tcp:192.168.194.95:16171", "waterlinked_a50", 2.0,
        notes=("the report has a time of validity from json_v3 on (firmware 2.1); update older firmware",),
    ),
    "a50-serial": Instrument(
        "Water Linked, serial line", "waterlinked-serial", "serial:/dev/ttyUSB0:115200", "waterlinked_a50", 2.0,
        notes=("the instrument must send wrz and wru (protocol version 2.1 or later)",),
    ),
    "pathfinder": Instrument(
        "Teledyne Pathfinder, Workhorse or Wayfinder in PD0", "pd0", "serial:/dev/ttyUSB0:115200", "teledyne_30", 2.0,
        notes=("set beam coordinates (EX00000) and PD0: other coordinates and PD6 hold no beams",),
    ),
    "dvl1000": Instrument(
        "Nortek DVL500 or DVL1000, DF21 over TCP", "nortek-dvl", "tcp:192.168.1.10:9002", "nortek_dvl1000", 2.0,
        notes=("the sign of the beams is not confirmed on a recording: run `bottomlock audit` on a log first",),
    ),
    "nucleus": Instrument(
        "Nortek Nucleus1000, TCP", "nucleus", "tcp:192.168.2.201:9000", "geometry.toml", 2.0,
        notes=(_OWN_GEOMETRY, "three beams: one lost beam already leaves a partial velocity"), beams=3,
    ),
    "tracker650": Instrument(
        "Cerulean Tracker 650, UDP", "cerulean-dvkfc", "udpin:0.0.0.0:27000", "geometry.toml", 2.0,
        notes=(_OWN_GEOMETRY, "three cones: one lost cone already leaves a partial velocity"), beams=3,
    ),
}  # fmt: skip


AUTOPILOTS = {
    "ardusub": Autopilot(
        "ArduSub (ArduPilot EKF3), body-frame odometry",
        "vision_position_delta", "udpout:127.0.0.1:14550", "navigation",
        (
            "set VISO_TYPE = 1 (MAVLink), EK3_SRC1_VELXY = 6 (all three axes), VISO_DELAY_MS = 50 + age on the page",
            'without an IMU set mode = "velocity" and remove the sections that it names:',
            "ArduPilot then gets a velocity only while the beams determine all of it",
        ),
        imu="udpin:0.0.0.0:14660",
    ),
    "px4": Autopilot(
        "PX4 EKF2, external vision velocity", "odometry", "udpout:127.0.0.1:14580", "navigation",
        (
            "set EKF2_EV_CTRL = 4 (velocity), EKF2_EV_DELAY = 0, EKF2_EV_NOISE_MD = 0, EKF2_EV_POS_* (docs/ports.md)",
            "the simulator listens on 14580 and sends to who speaks to it: one address for its IMU and for the port;",
            "on a vehicle give its telemetry line in both places, serial:DEVICE:BAUD",
            "10 messages a second with twice the variance (the default): slower ones may never start PX4",
        ),
        imu="udpout:127.0.0.1:14580", settings='settings.receiver = "px4"',
    ),
    "microstrain": Autopilot(
        "MicroStrain CV7 or GQ7, MIP 0x13,0x2A", "microstrain", "serial:/dev/ttyACM0:115200", "velocity",
        ("takes each axis by itself: the only port that gets all of a partial velocity without an IMU",),
    ),
    "dvl": Autopilot(
        "whatever reads a Water Linked DVL: the DVL with its lost velocities restored",
        "waterlinked_json", "tcpin:0.0.0.0:16171", "navigation",
        (
            "there give this computer's address in place of the DVL's; its commands are answered (docs/ports.md)",
            "needs HIGHRES_IMU, of ArduSub 4.6 or later, or an IMU of your own (docs/howto/rov.md)",
        ),
        imu="tcp:127.0.0.1:5777", asked=True,
    ),
    "ros2": Autopilot(
        "ROS 2, geometry_msgs/TwistWithCovarianceStamped as CDR",
        "ros_twist", "udpout:127.0.0.1:14600", "velocity",
        (
            "robot_localization takes this message as a twist; ros_velocity is for nodes of your own",
            "the datagrams are CDR: a small node of yours, or a bridge, publishes them",
        ),
    ),
    "text": Autopilot("a line of text an estimate", "sentence", "stdout", "velocity"),
}  # fmt: skip

IMU_HZ = 50
"""Rate of the IMU of an autopilot."""
_DVL = """{head}name = {name}
mode = "{mode}"   # "velocity": the beams alone; "navigation": with an IMU, which bridges lost beams

[dvl]
geometry = "{geometry}"   # packaged, or a TOML file with your mounting and lever arms
beam_noise_mps = {noise}   # 1 sigma of a beam: cautious; `bottomlock audit` measures it on a log

[[source]]
name = "dvl"
address = {address}
format = "{form}"
rate_hz = {rate:g}   # the least rate to expect: silent after three periods
{dvl_notes}"""
_NAVIGATION = f"""
[[source]]
name = "autopilot"
address = {{imu}}   # a telemetry stream with HIGHRES_IMU at {IMU_HZ} Hz or more
format = "mavlink"
rate_hz = {IMU_HZ}
{{request}}# An IMU of your own, in place of the one above, is better:
# [[source]]
# name = "imu"
# address = "serial:/dev/ttyUSB1:921600"   # lines time_ns,wx,wy,wz,fx,fy,fz*HH in rad/s and m/s^2
# format = "imu-csv"
# rate_hz = 100
# checksum = true   # every line must have its *HH: half a line can be another one (docs/live.md)

# What the inertial filter needs (docs/live.md). The errors are those of the IMU's data sheet, 1 sigma.
[origin]
latitude_deg = {{latitude_deg!r}}   # where you are

# Without inertial readings an attitude takes their place: source = "attitude" (docs/no_imu.md).
[imu]
rate_hz = {IMU_HZ}
accel_bias_mg = 5.0
gyro_bias_deg_per_h = 50.0
accel_noise_mps_per_rt_h = 0.1
gyro_noise_deg_per_rt_h = 0.3
mounting_roll_deg = 0.0   # from the IMU's axes to forward, starboard, down
mounting_pitch_deg = 0.0
mounting_yaw_deg = 0.0

# A compass or AHRS aids, its slow errors found (docs/live.md): also a source attitude-csv, or MAVLink's ATTITUDE.
{{attitude}}
[start]
window_s = 5.0            # keep the vehicle calm so long
{{heading}}
[navigation]
# {RECOMMENDED_METHOD}, which README recommends, is for a slender vehicle; tc assumes nothing of it (docs/methods/).
method = "{RECOMMENDED_METHOD}"
horizon_s = 2.0           # longest time from a ping's reflection to its arrival

# With lateral thrusters (ROV, hovering AUV) {RECOMMENDED_METHOD} needs the prior of its kind (docs/hovering.md):
{{hovers}}[filter.water]
{{hovers}}vehicle = "hovering"

[checkpoint]
file = "navigator.checkpoint"
"""
_PORT = """
[[port]]
port = "{port}"
to = {to}
{settings}"""
_LOG = """
# Every byte with its time of arrival: `bottomlock live --replay LOG THIS_FILE` gives the same bits again.
[log]
folder = "{folder}"
"""
_TAIL = """{notes}
[states]
velocity_sd_mps = 0.5   # nothing is sent beyond this 1 sigma
settle_s = 1.0          # a better state must hold so long
{log}
[health]
host = "127.0.0.1"   # "0.0.0.0" shows the page to the whole network
port = {health_port}
"""
_TO_BE_EDITED: dict[str, Any] = {
    "name": "vehicle", "latitude_deg": 0.0, "ports": (), "logs": "logs", "health_port": 8770, "hovers": "# ",
    "attitude": """# [attitude]
# aids = "heading"        # or "attitude"
# grade = "magnetic"      # `bottomlock list grades` lists them
# yaw_offset_deg = 0.0    # declination of a magnetic yaw
""",
    "heading": """heading_deg = 0.0         # of the vehicle at the start; left out: that of [attitude]
heading_sd_deg = 5.0
""",
}  # fmt: skip
# The heading of the start is the autopilot's own; it aids nothing, because it is made from the same inertial readings.
_OF_A_VEHICLE: dict[str, Any] = {
    "attitude": '[attitude]\nmessage = "ATTITUDE"\naids = "nothing"\nyaw_sd_deg = 5.0\n',
    "heading": "",
    "hovers": "",
    "request": True,
}


def template(instrument: str, autopilot: str, vehicle: dict[str, Any] | None = None) -> str:
    """The configuration for an instrument and an autopilot.

    Args:
        instrument, autopilot: their names.
        vehicle: one with lateral thrusters whose heading is the autopilot's: head (a comment), name, mode, address of
            the DVL, geometry, address of the imu, `to` and names of further ports, latitude_deg, folder of the logs or
            None, health_port. None for a template that is to be edited.

    Raises:
        ScenarioError: for an unknown name, with the nearest, and three beams for a report of four.
    """
    dvl, receiver = _named("instrument", instrument, INSTRUMENTS), _named("autopilot", autopilot, AUTOPILOTS)
    if autopilot == "dvl" and dvl.beams != INSTRUMENTS["a50"].beams:
        raise ScenarioError(
            f"{dvl.title} has {dvl.beams} beams, a Water Linked's report four",
            hint="name another autopilot than 'dvl'",
        )
    values = _TO_BE_EDITED | {
        "head": f"# bottomlock live: {dvl.title} to {receiver.title}.\n"
        "# Try it first with: bottomlock live --dry-run THIS_FILE\n",
        "mode": receiver.mode, "address": dvl.address, "geometry": dvl.geometry, "imu": receiver.imu,
        "to": receiver.to, "request": receiver.asked,
    }  # fmt: skip
    values |= {} if vehicle is None else _OF_A_VEHICLE | vehicle
    dvl_notes, notes = (
        "".join(f"# {note}\n" for note in one.notes if vehicle is None) for one in (dvl, receiver)
    )
    values |= {"request": f"request_hz = {IMU_HZ}\n" if values["request"] else ""}
    # A string of TOML is one of JSON, which escapes the same characters.
    values |= {key: json.dumps(values[key], ensure_ascii=False) for key in ("name", "address", "imu", "to")}
    text = _DVL.format(
        **values, noise=dvl.beam_noise_mps, form=dvl.format, rate=dvl.rate_hz, dvl_notes=dvl_notes
    )
    text += _NAVIGATION.format(**values) if values["mode"] == "navigation" else ""
    text += _PORT.format(
        **values, port=receiver.port, settings=receiver.settings and f"{receiver.settings}\n"
    )
    text += "".join(_PORT.format(**values, port=port, settings="") for port in values["ports"])
    log = "" if values["logs"] is None else _LOG.format(folder=values["logs"])
    return text + _TAIL.format(**values, notes=notes, log=log)


def _named(what: str, name: str, known: dict[str, _T]) -> _T:
    if name in known:
        return known[name]
    hint = did_you_mean(name, known)
    raise ScenarioError(f"unknown {what} '{name}'{hint} (known: {', '.join(known)})")
