"""The form of the set-up page, and the configuration of `bottomlock live` that it stands for.

The configuration is the TOML file that a person would write: the form has no meaning of its own.
"""

from typing import Annotated, Literal

from pydantic import Field, ValidationInfo, field_validator

from bottomlock.config.section import Section
from bottomlock.io.beams import geometry_text, read_geometry
from bottomlock.kernel.models import Finite, Real
from bottomlock.live.sections import Name
from bottomlock.live.templates import AUTOPILOTS, INSTRUMENTS, template
from bottomlock.ports.estimate import Mode
from bottomlock.setup.addresses import FormSource, FormTarget

LOGS = "logs"
"""Folder of the raw logs, beside the configuration."""
HEALTH_PORT = 8771
"""Of the live process, on the loopback address; the set-up page passes it on."""
ROUTER = "tcp:127.0.0.1:5777"
"""BlueOS' own "Internal Link": its MAVLink router, for what runs on the vehicle's computer."""
LOOKS_DOWN_DEG = 30.0
"""Of the mounting: up to here its beams measure the distance to the bottom, for the autopilot's rangefinder."""
FORM_INSTRUMENTS = {name: one for name, one in INSTRUMENTS.items() if not one.geometry.endswith(".toml")}
"""Those whose geometry is packaged; the others need a file of their own, and so a configuration by hand."""
FORM_AUTOPILOTS = {name: AUTOPILOTS[name] for name in ("ardusub", "px4", "dvl")}

_Degrees = Annotated[Real, Field(ge=-180, le=180)]
_Quarter = Annotated[Real, Field(ge=-90, le=90)]


class SetupForm(Section):
    """What the page asks for. The lever arm is from the autopilot's IMU to the DVL.

    The mounting angles rotate the DVL's axes to the vehicle's; pitch 90 is a DVL that looks forward.
    """

    name: Name = "vehicle"
    instrument: Literal[tuple(FORM_INSTRUMENTS)] = "a50"  # type: ignore[valid-type]
    address: FormSource = INSTRUMENTS["a50"].address
    mounting_roll_deg: _Degrees = 0.0
    mounting_pitch_deg: _Quarter = 0.0
    mounting_yaw_deg: _Degrees = 0.0
    lever_forward_m: Finite = 0.0
    lever_starboard_m: Finite = 0.0
    lever_down_m: Finite = 0.0
    autopilot: Literal[tuple(FORM_AUTOPILOTS)] = "ardusub"  # type: ignore[valid-type]
    to: FormTarget = ROUTER
    mode: Mode = "navigation"
    imu: FormSource = ROUTER
    latitude_deg: Annotated[_Quarter | None, Field(validate_default=True)] = None
    record: bool = True

    @field_validator("latitude_deg", mode="after")
    @classmethod
    def _needed_to_navigate(cls, latitude_deg: float | None, info: ValidationInfo) -> float | None:
        if latitude_deg is None and info.data.get("mode") == "navigation":
            raise ValueError(
                "missing, expected number in deg, -90 to 90: where the vehicle is, for gravity and the Earth's rate"
            )
        return latitude_deg


def geometry_of(form: SetupForm) -> str:
    """The geometry of the form's instrument with its mounting and lever arms, as TOML."""
    name = FORM_INSTRUMENTS[form.instrument].geometry
    lever_m = [form.lever_forward_m, form.lever_starboard_m, form.lever_down_m]
    beams = read_geometry(name).geometry.beams
    return (
        "# From the set-up page: the instrument's axes to the vehicle's, and each transducer from the autopilot.\n"
        f"mounting_roll_deg = {form.mounting_roll_deg!r}\n"
        f"mounting_pitch_deg = {form.mounting_pitch_deg!r}\n"
        f"mounting_yaw_deg = {form.mounting_yaw_deg!r}\n"
        f"lever_arms_m = {[lever_m] * beams}\n\n"
    ) + geometry_text(name)


def config_text(form: SetupForm, geometry: str) -> str:
    """The configuration of a form, as TOML, with the file of its geometry."""
    looks_down = max(abs(form.mounting_roll_deg), abs(form.mounting_pitch_deg)) < LOOKS_DOWN_DEG
    values = form.model_dump(include={"name", "mode", "address", "imu", "to", "latitude_deg"})
    values |= {
        "head": _HEAD,
        "geometry": geometry,
        "health_port": HEALTH_PORT,
        "logs": LOGS if form.record else None,
    }
    values |= {"ports": ("distance_sensor",) if looks_down and form.autopilot != "dvl" else ()}
    return template(form.instrument, form.autopilot, values)


_HEAD = """# From the set-up page of bottomlock. Edit it by hand where the page does not reach (docs/live.md): the page
# then runs it as it is, and says so before it replaces it.

"""
