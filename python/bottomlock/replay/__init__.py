"""Recordings reprocessed: case file, initial alignment, what-if beam losses, all methods against a reference.

Examples:
    The smallest case file:

    >>> from bottomlock.replay.case import parse_case
    >>> case = parse_case(
    ...     '''
    ... name = "dive_07"
    ... [imu]
    ... file = "imu.parquet"
    ... clock = { column = "t", unit = "s" }
    ... force = ["ax", "ay", "az"]
    ... omega = ["wx", "wy", "wz"]
    ... [imu.errors]
    ... accel_bias_mg = 0.5
    ... gyro_bias_deg_per_h = 3.0
    ... accel_noise_mps_per_rt_h = 0.072
    ... gyro_noise_deg_per_rt_h = 0.34
    ... [dvl]
    ... file = "beams.parquet"
    ... geometry = "x_janus_20"
    ... [start]
    ... heading = "gyrocompass"
    ... position_sd_m = [1.0, 1.0, 1.0]
    ... ''',
    ...     place="example",
    ... )
    >>> case.dvl.source, case.replay.methods[:3]
    ('beams', ('ins', 'lc', 'tc'))
"""
