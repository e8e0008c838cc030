"""Water track in a first case: where a water table stands beside the beams."""

from bottomlock.io.water_table import water_file
from bottomlock.replay.init.dvl_part import DvlPart
from bottomlock.replay.init.files import Files
from bottomlock.replay.init.sources import Sources
from bottomlock.replay.init.text import Section


def water_section(dvl: DvlPart, sources: Sources, files: Files) -> list[Section]:
    """`[water_track]` with the water table beside the beams of the case, or beside the log that they are from."""
    if dvl.recording is None or sources.log is None:
        return []
    own = next((one for one in files.written if water_file(one).is_file()), None)
    given = water_file(sources.log)
    if own is None and not given.is_file():
        return []
    section = Section("water_track")
    table = given if own is None else water_file(own)
    section.say(f"{table.name} has beams that the water returned: the current is a state of the filter")
    if own is None:
        section.put("file", files.relative(given))
    section.ask(
        "is the nearest cell in the vehicle's own wake? cells = [2, 3] leaves it out (docs/howto/water_track.md)"
    )
    return [section]
