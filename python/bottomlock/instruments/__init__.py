"""Simulated instruments: the pings of a run as a maker's bytes, in real time, with faults on request.

Examples:
    The bytes of the first two pings of a packaged scenario, as a Water Linked A50 would send them:

    >>> from bottomlock.config.scenario import load_scenario
    >>> from bottomlock.encoders.registry import encoder
    >>> from bottomlock.instruments.faults import NONE
    >>> from bottomlock.instruments.sources import readings_of_scenario
    >>> from bottomlock.instruments.schedule import records
    >>> scenario = load_scenario("straight").with_trajectory(duration_s=3.0)
    >>> readings = readings_of_scenario(scenario)
    >>> sent = list(records(readings, encoder("waterlinked-json", readings.geometry), NONE, seed=1))
    >>> len(sent), sent[0].data[:8]
    (3, b'{"time":')
"""
