"""What the ellipsoid costs a campaign's kernel, against a tangent plane.

    python benches/earth.py [--rounds 9] [--runs 16]

Rounds are interleaved on one thread; ratios are medians of the rounds' own, of the time that the thread had on a core.
"""

from __future__ import annotations

import argparse
import time

from campaign import METHODS, flight, spread

from bottomlock import kernel


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--runs", type=int, default=16)
    options = parser.parse_args()
    work = flight()
    for methods in (["tc"], METHODS):
        seconds: dict[str, list[float]] = {"tangent_plane": [], "ellipsoid": []}
        for _ in range(options.rounds):
            for earth, times in seconds.items():
                environment = work["assumed"].environment.replace(earth=earth)
                model = work["assumed"].replace(environment=environment)
                begin = time.process_time()
                kernel.run_batch(
                    **work | {"simulated": model, "assumed": model, "methods": methods},
                    runs=options.runs, threads=1,
                )  # fmt: skip
                times.append(time.process_time() - begin)
        ratios = [a / b for a, b in zip(seconds["ellipsoid"], seconds["tangent_plane"], strict=True)]
        print(f"{len(methods)} methods, ellipsoid / plane: {spread(ratios)}")


if __name__ == "__main__":
    main()
