"""Time of `bottomlock tune` over an hour at 100 Hz, and how many replays of that hour it takes.

    python -m benches.tune [THREADS]

Processor time is less a matter of what else runs than time by the clock is. The hour is simulated: four pings and ten
attitudes a second, noise begun at 10, 0.1 and 3 times the truth. The bits are the same with every number of threads.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from bottomlock.kernel import replay_log
from bottomlock.replay.case import load_case
from bottomlock.replay.tune.recording import read_recording
from bottomlock.replay.tune.run import tune_case
from tests.statistical.tune_logs import ACCEL_KEY, BEAM_KEY, GYRO_KEY, dive, write_case

REPLAYS = 5


def main(threads: int) -> None:
    """Prints both times, and what was found."""
    with TemporaryDirectory() as folder:
        hour = dive(1, seconds=3600.0, rate_hz=100.0, ping_hz=4.0, attitude_hz=10.0)
        case = load_case(write_case(Path(folder), hour, {ACCEL_KEY: 10.0, GYRO_KEY: 0.1, BEAM_KEY: 3.0}))
        recording = read_recording(case)
        inputs, log = recording.inputs({}), recording.log
        times_s = []
        for _ in range(REPLAYS):
            begun_s = time.process_time()
            replay_log(
                recording.geometry, inputs.model, inputs.options, ["tc"], log, recording.start,
                sample_time_ns=log["imu_time_ns"][-1:],
            )  # fmt: skip
            times_s.append(time.process_time() - begun_s)
        replay_s = float(np.median(times_s))
        processor_s = time.process_time()
        tuned = tune_case(case, threads=threads)
        processor_s = time.process_time() - processor_s
    print(
        f"{threads} threads: {tuned.wall_s:.1f} s, {processor_s:.1f} s of processor time, {tuned.passes} passes, "
        f"{tuned.iterations} iterations; a replay of the hour takes {replay_s:.2f} s of it [{min(times_s):.2f}, "
        f"{max(times_s):.2f}], {processor_s / replay_s:.0f} times less"
    )
    for one in tuned.parameters:
        print(
            f"{one.words}: {one.old:.4g} -> {one.value:.4g} ± {one.sd:.2g}{'' if one.is_determined else ', kept'}"
        )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 2)
