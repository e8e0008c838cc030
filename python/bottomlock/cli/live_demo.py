"""The command `bottomlock live-demo`: a simulated vehicle, `live` and a MAVLink listener on loopback."""

import asyncio

from bottomlock.cli.parameters import check_option

SHORTEST_S, LONGEST_S = 15.0, 600.0
FASTEST = 20.0


def live_demo(*, seconds: float = 60.0, speed: float = 1.0, page_port: int = 0) -> None:
    """Show live navigation without hardware: instruments, live, MAVLink listener.

    A simulated vehicle sends DVL, IMU and depth over loopback. Its beams go from four to two, to none, and come back.

    Args:
        seconds: Seconds of the run; the beams are lost in the same parts of it.
        speed: Seconds of the run per second.
        page_port: TCP port of the health page; 0 takes a free one.
    """
    _check(seconds, speed, page_port)
    from bottomlock.cli.demonstration import Demo, demo_scenario, say_now
    from bottomlock.instruments.sources import readings_of_scenario
    from bottomlock.ports.mavlink import dialect

    dialect()
    scenario = demo_scenario(seconds)
    say_now(
        f"simulated vehicle over loopback for {seconds:g} s of its run, at {speed:g} times the pace; Ctrl-C ends it"
    )
    demo = Demo(scenario, readings_of_scenario(scenario), seconds, speed, page_port)
    asyncio.run(demo.run())
    for sentence in demo.summary():
        say_now(sentence)


def _check(seconds: float, speed: float, page_port: int) -> None:
    check_option(
        "--seconds",
        f"{seconds:g}",
        f"{SHORTEST_S:g} to {LONGEST_S:g} s",
        holds=SHORTEST_S <= seconds <= LONGEST_S,
    )
    check_option("--speed", f"{speed:g}", f"above 0, to {FASTEST:g}", holds=0.0 < speed <= FASTEST)
    check_option("--page-port", page_port, "0 to 65535", holds=0 <= page_port <= 65_535)
