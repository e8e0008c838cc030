"""The sections of a navigator that is fed with what arrives, and what the kernel takes of them."""

import hashlib
import json
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Discriminator, Tag

from bottomlock import units
from bottomlock.config.dvl import CalibrationSection, DvlSettings
from bottomlock.config.imu import WEIGHTLESS_MPS2
from bottomlock.config.scenario_sections import Filter, Robust
from bottomlock.geodesy import Place
from bottomlock.io.beams import Instrument, read_geometry, read_instrument_file
from bottomlock.kernel import KernelError, models, normal_gravity_mps2
from bottomlock.live.sections import (
    LEVELLING_SD_DEG,
    ImuFromAttitude,
    ImuSection,
    LiveSections,
    NavigationSection,
    OriginSection,
    StartSection,
    kind_of_imu,
)
from bottomlock.recordings.readings import LOST_SD_MPS, AttitudeReading, ImuReading, Ping
from bottomlock.recordings.rotation import matrix, permute_axes, quaternion
from bottomlock.recordings.sensors import of_kernel


class NavigatorConfig(LiveSections):
    """The DVL, the other sensors, the start and the filter; where readings come from is not here."""

    dvl: DvlSettings
    imu: (
        Annotated[
            Annotated[ImuSection, Tag(ImuSection.__name__)]
            | Annotated[ImuFromAttitude, Tag(ImuFromAttitude.__name__)],
            Discriminator(kind_of_imu),
        ]
        | None
    ) = None
    origin: OriginSection | None = None
    start: StartSection | None = None
    navigation: NavigationSection = NavigationSection()
    filter: Filter = Filter()
    robust: Robust = Robust()
    calibration: CalibrationSection = CalibrationSection()

    def start_is_known(self, *, by_attitude: bool) -> None:
        """Checks that somebody gives the initial level and heading, and the place where positions need one.

        Raises:
            ValueError: where nobody does, or two do.
        """
        start, attitude, origin = self.start, self.attitude, self.origin
        assert start is not None  # seen before
        assert origin is not None
        if self.gps is not None and origin.longitude_deg is None:
            raise ValueError("'origin.longitude_deg' is missing, expected number in deg: [gps] needs it")
        if by_attitude:
            if attitude is None:
                raise ValueError('imu.source = "attitude" needs the section [attitude], which is missing')
            attitude.replaces_inertial_readings()
            if start.heading_deg is not None:
                raise ValueError(
                    "'start.heading_deg' is given, but imu.source = \"attitude\" gives the heading"
                )
            if start.level == "levelling":
                raise ValueError(
                    'start.level = "levelling" needs inertial readings, and imu.source is "attitude": set '
                    'start.level = "attitude"'
                )
        elif attitude is None:
            if start.level == "attitude":
                raise ValueError('start.level = "attitude" needs the section [attitude], which is missing')
            if start.heading_deg is None:
                raise ValueError(
                    "'start.heading_deg' is missing, expected number in deg: heading of the platform at the start, "
                    "which only a section [attitude] can give instead"
                )
        elif attitude.aids == "nothing" and start.heading_deg is not None and start.level != "attitude":
            raise ValueError(
                'attitude.aids is "nothing", and the start does not use [attitude] either: set attitude.aids = '
                '"attitude" or "heading", or leave start.heading_deg out'
            )

    @property
    def motion(self) -> str:
        """The readings that move the vehicle: a key of `FORMATS`."""
        return "attitude" if isinstance(self.imu, ImuFromAttitude) else "imu"

    @property
    def moved_by(self) -> type[AttitudeReading | ImuReading]:
        """The class of these readings."""
        return AttitudeReading if isinstance(self.imu, ImuFromAttitude) else ImuReading

    @property
    def home(self) -> Place | None:
        """The origin of the tangent frame; None where its longitude is not known."""
        origin = self.origin
        if origin is None or origin.longitude_deg is None:
            return None
        latitude, longitude = map(units.rad_from_deg, (origin.latitude_deg, origin.longitude_deg))
        return Place(latitude, longitude, origin.height_m)

    @property
    def level_by_attitude(self) -> bool:
        """Whether roll and pitch of the start are those of [attitude]."""
        return isinstance(self.imu, ImuFromAttitude) or (
            self.start is not None and self.start.level == "attitude"
        )

    def initial(self) -> models.InitialModel:
        """1 sigma of the state at the start, of a configuration in mode navigation."""
        start, attitude = self.start, self.attitude
        assert start is not None  # validated
        level, heading = start.level_sd_deg or LEVELLING_SD_DEG, start.heading_sd_deg
        if attitude is not None:
            heading = heading or attitude.start_yaw_sd_deg
            if self.level_by_attitude:
                level = start.level_sd_deg or attitude.start_roll_pitch_sd_deg
        assert heading is not None  # validated
        tilt_rad, yaw_rad = map(units.rad_from_deg, (level, heading))
        return models.InitialModel(
            position_sd_m=start.position_sd_m,
            attitude_sd_rad=(tilt_rad, tilt_rad, yaw_rad),
            velocity_sd_mps=start.velocity_sd_mps,
        )

    def instrument(self) -> Instrument:
        """Geometry of the DVL and noise of its beams.

        Raises:
            ScenarioError: as `read_geometry`.
        """
        noise = {key: getattr(self.dvl, key) for key in ("beam_noise_mps", "beam_noise_mps_per_m")}
        return read_geometry(self.dvl.geometry, **noise)

    def with_noise(self, ping: Ping, instrument: Instrument) -> Ping:
        """The ping with the noise of its beams that the filter takes: the geometry's, or its own figures of merit.

        Raises:
            KernelError: for a valid beam without a figure where the section asks for it, or without a range that its
                noise grows with.
        """
        key, name, given = 'beam_noise_from = "recording"', "figure of merit", ping.sd_mps
        sd = given
        if self.dvl.beam_noise_from == "geometry":
            if instrument.beam_sd_mps_per_m == 0.0:
                return replace(ping, sd_mps=instrument.beam_sd_mps)
            key, name, given = "beam_noise_mps_per_m", "range", ping.range_m
            sd = instrument.noise_mps(given)
        stated = sd > 0.0
        wrong = np.flatnonzero(ping.valid & ~stated)
        if wrong.size:
            raise KernelError(
                f"beam {wrong[0] + 1} is valid and its {name} is {given[wrong[0]]}",
                expected=f"more than 0: dvl.{key} needs it of every valid beam",
            )
        return replace(ping, sd_mps=np.where(stated, sd, LOST_SD_MPS))

    def content_hash(self) -> str:
        """SHA-256 of every section that a navigator is made of, and of the DVL's geometry by what its file says.

        Raises:
            ScenarioError: as `read_geometry`.
        """
        content = self.model_dump(mode="json", include=set(NavigatorConfig.model_fields))
        content["dvl"]["geometry"] = read_instrument_file(self.dvl.geometry).model_dump(
            mode="json", exclude={"name", "columns"}
        )
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


@dataclass(frozen=True)
class KernelSettings:
    """What a navigator is made of: model, options, and the rotation (3, 3) from the IMU's axes to the platform's.

    `gravity_mps2` is that of the place, also where the readings are without it.
    """

    model: models.Model
    options: models.Options
    imu_axes: NDArray[np.float64]
    gravity_mps2: float


def kernel_settings(config: NavigatorConfig, instrument: Instrument) -> KernelSettings:
    """Model and options in SI, as the kernel takes them, of a configuration in mode navigation.

    Raises:
        KernelError: for values that the kernel does not take.
    """
    imu, origin = config.imu, config.origin
    assert imu is not None  # validated in LiveConfig
    assert origin is not None
    latitude = units.rad_from_deg(origin.latitude_deg)
    gravity = normal_gravity_mps2(latitude) if origin.gravity == "normal" else float(origin.gravity)
    sensors, added = of_kernel(config)
    # A motion made from attitudes has their errors.
    gyro_noise_rad_rts = 0.0 if config.attitude is None else config.attitude.gyro_noise_rad_rts
    model = models.Model(
        environment=models.Environment(
            latitude_rad=latitude,
            gravity_mps2=WEIGHTLESS_MPS2 if isinstance(imu, ImuFromAttitude) else gravity,
            earth=origin.earth,
        ),
        imu=imu.kernel_model() if isinstance(imu, ImuSection) else imu.kernel_model(0.0, gyro_noise_rad_rts),
        dvl=config.dvl.errors.kernel_model(float(instrument.beam_sd_mps.mean()), instrument.calibration),
        initial=config.initial(),
        **sensors,
    )
    own = {
        "robust": config.robust.kernel_options(),
        "imu_limits": imu.limits.kernel_limits().replace(gap="inflate"),
        "imu_sampling": "averaged" if isinstance(imu, ImuFromAttitude) else imu.sampling,
        "calibration": config.calibration.prior(instrument.calibration),
    }
    options = models.Options.of(config.filter.kernel_options(), own, *added)
    axes = np.eye(3)
    if isinstance(imu, ImuSection):
        axes = matrix(np.array(quaternion(*imu.mounting_rpy_rad))) @ permute_axes(np.eye(3), imu.axes).T
    return KernelSettings(model, options, axes, gravity)
