"""What each port loses of an estimate, as the table in docs/ports.md: `python tools/port_losses.py` prints it.

Estimates are those of an x-Janus at 20° with beams of 0.02 m/s: in mode velocity of one ping alone, in mode navigation
of the same ping and an inertial solution that has drifted, with correlations as a turn leaves them. Ports have their
default settings.
"""

import math

import numpy as np
from numpy.typing import NDArray

from bottomlock.kernel import BeamGeometry, solve_velocity
from bottomlock.ports.estimate import Beams, Estimate
from bottomlock.ports.port import Loss
from bottomlock.ports.registry import PORTS, port

Floats = NDArray[np.float64]

JANUS = BeamGeometry.janus(np.deg2rad(20.0))
BEAM_SD_MPS = 0.02
VELOCITY_P_MPS = np.array([1.8, -0.3, 0.15])
MASKS = {
    "4 beams": (1, 1, 1, 1),
    "3 beams": (1, 1, 1, 0),
    "2 opposite": (1, 0, 1, 0),
    "2 neighbours": (1, 1, 0, 0),
    "1 beam": (1, 0, 0, 0),
    "no beam": (0, 0, 0, 0),
}
_SD_MPS = np.array([0.15, 0.25, 0.08])
INERTIAL_M2PS2: Floats = np.array([[1.0, 0.95, 0.9], [0.95, 1.0, 0.92], [0.9, 0.92, 1.0]]) * np.outer(
    _SD_MPS, _SD_MPS
)
"""Covariance of the inertial solution before the ping."""

SETTINGS: dict[str, dict[str, object]] = {
    "pd0": {"receiver_sd_mps": 0.1, "geometry": JANUS},
    "waterlinked_json": {"geometry": JANUS},
    "ros_dvl": {"geometry": JANUS},
    "distance_sensor": {"geometry": JANUS},
    "vision_position_delta": {"variance_factor": 1.0},
    "vision_speed_estimate": {"variance_factor": 1.0},
    "odometry": {"variance_factor": 1.0},
}


def fused(mask: tuple[int, ...]) -> Floats:
    """(3, 3) covariance of the inertial solution after a ping of these beams, m²/s²."""
    rows = JANUS.directions_p[np.array(mask, dtype=bool)]
    after = np.linalg.inv(np.linalg.inv(INERTIAL_M2PS2) + rows.T @ rows / BEAM_SD_MPS**2)
    return np.asarray(0.5 * (after + after.T), dtype=np.float64)


def estimates(mask: tuple[int, ...]) -> dict[str, Estimate]:
    """The estimate of each mode for a mask."""
    seen = np.array(mask, dtype=bool)
    readings = np.where(seen, JANUS.beam_velocities([VELOCITY_P_MPS])[0], np.nan)
    beams = Beams(velocity_mps=readings, sd_mps=np.full(4, BEAM_SD_MPS), range_m=np.where(seen, 30.0, np.nan))
    fixes = solve_velocity(JANUS, [readings], [seen], method="info", beam_sd_mps=BEAM_SD_MPS)
    joint = np.diag([1.0, 1.0, 0.01, 1e-6, 1e-6, 1e-4, 1.0, 1.0, 1.0])
    joint[6:, 6:] = fused(mask)
    navigation = {
        "time_ns": 1,
        "position_t_m": np.zeros(3),
        "attitude_t_p": np.array([1.0, 0.0, 0.0, 0.0]),
        "velocity_p_mps": VELOCITY_P_MPS,
    }
    return {
        "velocity": Estimate.from_fix(1, fixes, beams=beams),
        "navigation": Estimate.from_state(navigation, joint, fixes=fixes, beams=beams),
    }


def _cell(loss: Loss) -> str:
    """Ratios of σ by axis, the information lost, and the axes left out."""
    if loss.reason is not None:
        return "nothing"
    ratios = " ".join("–" if math.isnan(ratio) else f"{ratio:.2f}" for ratio in loss.sd_ratio.tolist())
    lost = f"; {loss.axes_lost} off" if loss.axes_lost else ""
    nat = 0.0 if abs(loss.information_nat) < 0.005 else loss.information_nat
    return f"{ratios} ({nat:.2f}{lost})"


def table(mode: str) -> list[str]:
    """Lines of the table of one mode, in Markdown: a row each port, a column each mask."""
    cases = {name: estimates(mask)[mode] for name, mask in MASKS.items()}
    lines = [f"| Port | {' | '.join(cases)} |", f"|---|{'---|' * len(cases)}"]
    for name in PORTS:
        one = port(name, **SETTINGS.get(name, {}))
        cells = [_cell(one.loss(estimate)) for estimate in cases.values()]
        lines.append(f"| `{name}` | {' | '.join(cells)} |")
    return lines


if __name__ == "__main__":
    for mode in ("velocity", "navigation"):
        print(f"Mode {mode}:\n")
        print("\n".join(table(mode)), end="\n\n")
