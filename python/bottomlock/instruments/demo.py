"""The run of `bottomlock live-demo`: a packaged survey whose DVL loses two beams, then all, and gets them back."""

from bottomlock.config.scenario import Scenario, load_scenario
from bottomlock.instruments.from_scenario import with_geometry

SCENARIO, GEOMETRY = "survey_table2", "waterlinked_a50"
TWO_FROM, NONE_FROM, BACK_FROM = 0.3, 0.55, 0.75
"""Parts of the duration: from here on two beams return, none, and all again."""
LOST_FIRST = (3, 4)
DVL_HZ = 5.0
SEABED_M = 60.0
SENT_AFTER_S = 5.0
"""The instruments send so much longer: what listens ends first."""


def demo_scenario(seconds: float) -> Scenario:
    """The scenario of a demonstration that lasts so many seconds.

    It is the packaged one at constant depth, so that the vehicle is calm while it aligns, over a seabed that is near
    enough for all beams; they are lost by outages alone.
    """
    scenario = load_scenario(SCENARIO).with_trajectory(duration_s=seconds + SENT_AFTER_S)
    two_s, none_s, back_s = (part * seconds for part in (TWO_FROM, NONE_FROM, BACK_FROM))
    outages = [
        {"beams": LOST_FIRST, "from_s": two_s, "to_s": none_s},
        {"beams": (1, 2, 3, 4), "from_s": none_s, "to_s": back_s},
    ]
    changes = {
        "mission.dive_rate_mps": 0.0,
        "seabed.depth_m": SEABED_M,
        "dvl.rate_hz": DVL_HZ,
        "dvl.outages": outages,
    }
    return with_geometry(scenario.replace(changes), GEOMETRY)
