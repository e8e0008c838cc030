"""first_fix.c by ctypes, for programs that do not import the package: python first_fix.py libbottomlock.so."""

import ctypes
import json
import sys
from ctypes import POINTER, c_char_p, c_double, c_int, c_int64, c_size_t, c_uint8, c_void_p


class State(ctypes.Structure):
    """bl_state."""

    _fields_ = (
        ("time_ns", c_int64),
        ("position_t_m", c_double * 3),
        ("attitude_t_p", c_double * 4),
        ("velocity_p_mps", c_double * 3),
        ("accel_bias_p_mps2", c_double * 3),
        ("gyro_bias_p_radps", c_double * 3),
        ("dvl_bias_mps", c_double * 4),
        ("dvl_scale_factor", c_double),
    )


def declared(path: str) -> ctypes.CDLL:
    """The library with the types of what is called here: a pointer without one would be cut to 32 bits."""
    library = ctypes.CDLL(path)
    numbers = POINTER(c_double)
    for name, result, arguments in (
        ("last_error", c_char_p, []),
        ("navigator_from_json", c_void_p, [c_char_p]),
        ("push_imu", c_int, [c_void_p, c_int64, numbers, numbers]),
        ("push_beams", c_int, [c_void_p, c_int64, c_size_t, numbers, POINTER(c_uint8), numbers]),
        ("navigator_state", c_int, [c_void_p, POINTER(State)]),
        ("navigator_free", None, [c_void_p]),
    ):
        function = getattr(library, f"bl_{name}")
        function.restype, function.argtypes = result, arguments
    return library


def main(path: str) -> None:
    """Runs a navigator for ten seconds."""
    bl = declared(path)

    def check(status: int) -> None:
        if status:
            raise SystemExit(bl.bl_last_error().decode())

    beams, sd = (c_double * 4)(0.484, -0.484, -0.484, 0.0), (c_double * 4)(*[0.02] * 4)
    valid = (c_uint8 * 4)(1, 1, 1, 0)
    omega, force = (c_double * 3)(), (c_double * 3)(0.0, 0.0, -9.806)
    given = {
        "geometry": {"preset": "x_janus_20"},
        "model": {
            "preset": "tactical",
            "latitude_rad": 0.78,
            "initial": {"velocity_sd_mps": [0.3, 0.3, 0.3]},
        },
        "start": {"velocity_p_mps": [1.9, 0, 0]},
    }
    navigator = bl.bl_navigator_from_json(json.dumps(given).encode())
    if navigator is None:
        raise SystemExit(bl.bl_last_error().decode())
    state = State()
    for step in range(1, 1001):
        time_ns = step * 10_000_000
        check(bl.bl_push_imu(navigator, time_ns, omega, force))
        if step % 100 == 0:
            check(bl.bl_push_beams(navigator, time_ns, 4, beams, valid, sd))
    check(bl.bl_navigator_state(navigator, ctypes.byref(state)))
    print("velocity {:.3f} {:.3f} {:.3f} m/s".format(*state.velocity_p_mps))
    bl.bl_navigator_free(navigator)


if __name__ == "__main__":
    main(sys.argv[1])
