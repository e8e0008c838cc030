"""Sections of a case file about the beams: where they come from, what is put on them, what is taken away."""

import math
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from bottomlock.config.scenario_sections import AltitudeLoss, Dropout, NonNegative, Outage, Positive, Section
from bottomlock.replay.stream_sections import Clock, Mounted, Names

Beam = Annotated[int, Field(ge=1, le=8)]


class Recorded(Section):
    """Another recording of beams: its file, and the geometry that says what its columns mean."""

    file: Path
    geometry: str = "x_janus_20"


class BeamNoise(Section):
    """Noise put on projected beams, drawn from the case's seed: white, or from real closure residuals.

    "closure" draws, with replacement, from the closure residuals of the pings of `of` that have every beam: the reading
    along the one combination of beams that no velocity can cause, whose spread is that of a single beam. `scale`
    stretches either.
    """

    kind: Literal["none", "white", "closure"] = "none"
    sd_mps: Positive | None = None
    of: Recorded | None = None
    scale: Positive = 1.0

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if (self.kind == "white") != (self.sd_mps is not None):
            raise ValueError("'sd_mps' belongs to kind = \"white\", and it needs it")
        if (self.kind == "closure") != (self.of is not None):
            raise ValueError("'of' (a recording of beams) belongs to kind = \"closure\", and it needs it")
        return self


class DvlErrors(Section):
    """What the filter assumes of the DVL beside the beams' noise, 1 sigma."""

    beam_bias_mps: NonNegative = 0.005
    beam_bias_walk_mps_per_rt_s: NonNegative = 5e-5
    scale_factor_percent: NonNegative = 0.7
    scale_factor_walk_percent_per_rt_s: NonNegative = 5e-3


class DvlStream(Mounted):
    """Beams as recorded (source "beams"), or projected from the instrument's velocity ("velocity", semi-synthetic).

    `geometry` is a TOML file of the instrument or a packaged name: directions, mounting, lever arms, noise of the
    beams, and the columns of recorded beams. A beam table of `bottomlock convert` needs no clock. A velocity, three
    columns in the instrument's own frame after `axes`, is divided by `velocity_scale` and projected on the
    geometry's directions before its mounting; an empty row is no ping,
    one that the column `valid` flags 0 a ping without beams.
    """

    source: Literal["beams", "velocity"] = "beams"
    clock: Clock = Clock(column="time_ns", unit="ns")
    geometry: str
    velocity: Names | None = None
    velocity_unit: Literal["m/s", "cm/s", "mm/s"] = "m/s"
    velocity_scale: Positive = 1.0
    valid: str | None = None
    noise: BeamNoise = BeamNoise()
    beam_noise_mps: Positive | None = None
    beam_noise_from: Literal["geometry", "recording"] = "geometry"
    errors: DvlErrors = DvlErrors()

    @model_validator(mode="after")
    def _of_one_source(self) -> Self:
        if (self.source == "velocity") != (self.velocity is not None):
            raise ValueError("'velocity' (three columns) belongs to source = \"velocity\", and it needs it")
        turned = any((self.mounting_roll_deg, self.mounting_pitch_deg, self.mounting_yaw_deg))
        if turned:
            raise ValueError("the mounting of the DVL stands in its geometry file")
        if self.source == "beams":
            for key in ("axes", "velocity_scale", "valid", "velocity_unit", "noise"):
                if key in self.model_fields_set:
                    raise ValueError(
                        f"'{key}' belongs to source = \"velocity\"; recorded beams stay as they are"
                    )
            if "clock" in self.model_fields_set and self.clock.column is None:
                raise ValueError(
                    "recorded beams have stamps: clock.column, in nanoseconds 'time_ns' by default"
                )
        elif "clock" not in self.model_fields_set:
            raise ValueError("source = \"velocity\" needs a 'clock'")
        if self.beam_noise_from == "recording" and (
            self.source != "beams" or self.beam_noise_mps is not None
        ):
            raise ValueError(
                'beam_noise_from = "recording" belongs to source = "beams" without beam_noise_mps'
            )
        return self


class Robust(Section):
    """What is done against beams that err more than a Gaussian does, before a method makes anything of a ping.

    Gates by closure and by single beams, as the probability with which a good one passes, and the tail of the beams'
    noise. Without the section nothing is done.
    """

    closure_gate: Annotated[float, Field(gt=0, lt=1)] | None = None
    beam_gate: Annotated[float, Field(gt=0, lt=1)] | None = None
    tail: Literal["gaussian", "student_t", "huber"] = "gaussian"
    student_t_degrees: Positive = 4.0
    huber_threshold: Positive = 1.345


class WhatIf(Section):
    """A question: which beams would not have returned. Rules combine, each must let a beam through.

    Times are seconds from the start of the navigation. `validity_of` takes the pattern of another recording,
    repeated end to end, from `validity_from_s` on; `dropouts` and `altitude_loss` are Markov chains drawn from the
    case's seed.
    """

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9_\-]+$")]
    beams_lost: tuple[Beam, ...] = ()
    outages: tuple[Outage, ...] = ()
    dropouts: tuple[Dropout, ...] = ()
    altitude_loss: AltitudeLoss | None = None
    validity_of: Recorded | None = None
    validity_from_s: NonNegative = 0.0

    @model_validator(mode="after")
    def _asks_something(self) -> Self:
        if self.name == "recorded":
            raise ValueError("the name 'recorded' is taken: it is the recording with nothing lost")
        if not (self.beams_lost or self.outages or self.dropouts or self.altitude_loss or self.validity_of):
            raise ValueError(f"what_if '{self.name}' takes no beam away")
        for outage in self.outages:
            if not outage.to_s > outage.from_s:
                raise ValueError(
                    f"an outage from {outage.from_s} s to {outage.to_s} s, expected it to end later"
                )
        coming_and_going = [beam for dropout in self.dropouts for beam in dropout.beams]
        for beam in coming_and_going:
            if coming_and_going.count(beam) > 1:
                raise ValueError(f"beam {beam} stands in two dropouts, expected one at most")
        return self

    @property
    def by_chance(self) -> bool:
        """Whether a seed decides."""
        return bool(self.dropouts) or self.altitude_loss is not None

    @property
    def beams_named(self) -> tuple[int, ...]:
        """Every beam that a rule names."""
        lists = (self.beams_lost, *(o.beams for o in self.outages), *(d.beams for d in self.dropouts))
        return tuple(beam for beams in lists for beam in beams)

    def words(self) -> str:
        """What is taken away, for people."""
        parts = [f"beams {_join(self.beams_lost)} lost throughout"] if self.beams_lost else []
        for outage in self.outages:
            end = "the end" if math.isinf(outage.to_s) else f"{outage.to_s:g} s"
            parts.append(f"beams {_join(outage.beams)} lost from {outage.from_s:g} s to {end}")
        parts += [
            f"beams {_join(d.beams)} up {d.mean_up_s:g} s and down {d.mean_down_s:g} s on average"
            for d in self.dropouts
        ]
        if self.altitude_loss is not None:
            up, down = self.altitude_loss.mean_up_s, self.altitude_loss.mean_down_s
            parts.append(f"all beams up {up:g} s and down {down:g} s on average")
        if self.validity_of is not None:
            parts.append(f"validity of {self.validity_of.file.name} from {self.validity_from_s:g} s on")
        return "; ".join(parts)


def _join(beams: tuple[int, ...]) -> str:
    return ", ".join(str(beam) for beam in beams)
