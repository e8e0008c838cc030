"""Aided inertial navigation with whatever Doppler velocity log beams are left.

Frames: tangent north-east-down, fixed to the Earth; platform forward-right-down. Quaternions are scalar first and map
platform to tangent. SI units and radians; time is integer nanoseconds. Errors are true minus estimate. Beams are
numbered from 1 in text and columns, and from 0 in arrays.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    __version__: str

    from bottomlock import own_method
    from bottomlock.campaign.run import Results, read_results, run_campaign
    from bottomlock.config.instrument_grades import imu, vehicle_water
    from bottomlock.config.scenario import Scenario, load_scenario, packaged_scenarios
    from bottomlock.errors import (
        BottomlockError,
        DataError,
        EngineError,
        KernelError,
        OutputError,
        ScenarioError,
    )
    from bottomlock.io.beam_table import read_beam_table
    from bottomlock.io.beams import read_beams, read_geometry
    from bottomlock.io.formats import read_recording
    from bottomlock.kernel import (
        FIX_METHODS,
        METHODS,
        BeamGeometry,
        Navigator,
        Report,
        VelocityFixes,
        normal_gravity_mps2,
        replay_log,
        run_batch,
        simulate_sensors,
        solve_velocity,
    )
    from bottomlock.kernel.models import (
        AcousticPositionModel,
        Assumptions,
        Calibration,
        CurrentLayers,
        DepthModel,
        DvlModel,
        DvlOutlierModel,
        Environment,
        GpsModel,
        HeadingModel,
        ImuLimits,
        ImuModel,
        InitialModel,
        InitialState,
        Levers,
        MagnetometerModel,
        Model,
        Motion,
        Options,
        Robust,
        SpeedBound,
        ThrustModel,
        Water,
        WaterTrackModel,
    )
    from bottomlock.live.started import StartedNavigator
    from bottomlock.recordings.attitude_motion import MotionFromAttitude
    from bottomlock.recordings.readings import (
        AcousticPositionReading,
        AttitudeReading,
        DepthReading,
        EffortReading,
        GpsReading,
        ImuReading,
        Ping,
        ThrustReading,
        WaterReading,
    )
    from bottomlock.replay.open_log import Log, open_log
    from bottomlock.replay.shown_replay import Replay, run_replay
    from bottomlock.simulation.analytic import analytic_truth
    from bottomlock.simulation.build import Simulation, build_simulation
    from bottomlock.simulation.measurement_schedule import measurement_schedule
    from bottomlock.simulation.path import truth_from_path
    from bottomlock.simulation.sensor_streams import sensor_streams
    from bottomlock.truth import Truth

__all__ = [
    "FIX_METHODS", "METHODS", "AcousticPositionModel", "AcousticPositionReading", "Assumptions",
    "AttitudeReading", "BeamGeometry", "BottomlockError", "Calibration", "CurrentLayers", "DataError",
    "DepthModel", "DepthReading", "DvlModel", "DvlOutlierModel", "EffortReading", "EngineError",
    "Environment", "GpsModel", "GpsReading", "HeadingModel", "ImuLimits", "ImuModel", "ImuReading",
    "InitialModel", "InitialState", "KernelError", "Levers", "Log", "MagnetometerModel", "Model", "Motion",
    "MotionFromAttitude", "Navigator", "Options", "OutputError", "Ping", "Replay", "Report", "Results",
    "Robust", "Scenario", "ScenarioError", "Simulation", "SpeedBound", "StartedNavigator", "ThrustModel",
    "ThrustReading", "Truth", "VelocityFixes", "Water", "WaterReading", "WaterTrackModel", "analytic_truth",
    "build_simulation", "imu", "load_scenario", "measurement_schedule", "normal_gravity_mps2", "open_log",
    "own_method", "packaged_scenarios", "read_beam_table", "read_beams", "read_geometry", "read_recording",
    "read_results", "replay_log", "run_batch", "run_campaign", "run_replay", "sensor_streams",
    "simulate_sensors", "solve_velocity", "truth_from_path", "vehicle_water",
]  # fmt: skip

# Each name is imported when it is first used: the command's help needs no numpy, and a vehicle's computer no polars.
_LAZY = {
    name: f"bottomlock.{module}"
    for module, names in {
        "campaign.run": "Results read_results run_campaign",
        "config.instrument_grades": "imu vehicle_water",
        "config.scenario": "Scenario load_scenario packaged_scenarios",
        "errors": "BottomlockError DataError EngineError KernelError OutputError ScenarioError",
        "io.beam_table": "read_beam_table",
        "io.beams": "read_beams read_geometry",
        "io.formats": "read_recording",
        "kernel": (
            "BeamGeometry FIX_METHODS METHODS Navigator Report VelocityFixes normal_gravity_mps2 "
            "replay_log run_batch simulate_sensors solve_velocity"
        ),
        "kernel.models": (
            "AcousticPositionModel Assumptions Calibration CurrentLayers DepthModel DvlModel "
            "DvlOutlierModel Environment GpsModel HeadingModel ImuLimits ImuModel "
            "InitialModel InitialState Levers MagnetometerModel Model Motion Options Robust SpeedBound "
            "ThrustModel Water WaterTrackModel"
        ),
        "live.started": "StartedNavigator",
        "own_method": "own_method",
        "recordings.attitude_motion": "MotionFromAttitude",
        "recordings.readings": (
            "AcousticPositionReading AttitudeReading DepthReading EffortReading GpsReading ImuReading "
            "Ping ThrustReading WaterReading"
        ),
        "replay.open_log": "Log open_log",
        "replay.shown_replay": "Replay run_replay",
        "simulation.build": "Simulation build_simulation",
        "simulation.measurement_schedule": "measurement_schedule",
        "simulation.sensor_streams": "sensor_streams",
        "simulation.analytic": "analytic_truth",
        "simulation.path": "truth_from_path",
        "truth": "Truth",
    }.items()
    for name in names.split()
}


def __getattr__(name: str) -> Any:  # noqa: ANN401 - a module's attributes are anything
    if name == "__version__":
        return importlib.import_module("bottomlock.kernel").kernel_version()
    if name in _LAZY:
        module = importlib.import_module(_LAZY[name])
        return module if module.__name__ == f"{__name__}.{name}" else getattr(module, name)
    raise AttributeError(f"module 'bottomlock' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted([*__all__, *(name for name in globals() if name.startswith("__")), "__version__"])
