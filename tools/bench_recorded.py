"""What PartialDVL-Bench takes from recordings that may be republished: a shape of beam noise and a pattern of loss.

    python tools/bench_recorded.py

writes `recorded.toml`, `riverpro.csv` and `riverpro_license.md` in python/bottomlock/bench anew, from
data/logs/pd0_riverpro (the pings with four beams, and their closure residuals over the half-width of 68.3 %) and
data/logs/pd0_glider (beams of every ensemble that met the bottom).
"""

from __future__ import annotations

import struct
import sys
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bottomlock.files.atomic_write import write_text
from bottomlock.io import pd0
from bottomlock.io.beams import read_geometry
from bottomlock.recordings.closure import closure_residuals

ROOT = Path(__file__).resolve().parent.parent
OUT = ROOT / "python" / "partialdvl_bench" / "recorded.toml"
HEADER, VARIABLE_LEADER, BOTTOM_TRACK = b"\x7f\x7f", 0x0080, 0x0600


def noise() -> list[float]:
    """Closure residuals of the RiverPro, over their half-width of 68.3 %."""
    path = ROOT / "data" / "logs" / "pd0_riverpro" / "RiverPro_test01.PD0"
    beams = pd0.read(path.read_bytes(), path.name).table
    residuals = closure_residuals(read_geometry("teledyne_20").geometry, beams.velocity_mps, beams.valid)
    return [float(value) for value in np.round(residuals / np.quantile(np.abs(residuals), 0.683), 4)]


def pings() -> str:
    """The pings of the RiverPro with four beams, CSV, with the source and where the licence is."""
    path = ROOT / "data" / "logs" / "pd0_riverpro" / "RiverPro_test01.PD0"
    beams = pd0.read(path.read_bytes(), path.name).table
    lines = [
        "# Pings with four beams of RiverPro_test01.PD0 (MHKiT-Python, BSD-3: riverpro_license.md); m/s",
        "time_ns,beam1_mps,beam2_mps,beam3_mps,beam4_mps",
    ]
    for time_ns, reading, valid in zip(beams.time_ns, beams.velocity_mps, beams.valid, strict=True):
        if valid.all():
            lines.append(",".join([str(time_ns - beams.time_ns[0]), *(f"{value:.3f}" for value in reading)]))
    return "\n".join(lines) + "\n"


def pattern() -> tuple[list[float], list[str]]:
    """Times from the first ensemble, s, and for each beam of an ensemble whether its range to the bottom is known."""
    data = (ROOT / "data" / "logs" / "pd0_glider" / "LA100204.PD0").read_bytes()
    times, beams, at = [], [], 0
    while (at := data.find(HEADER, at)) >= 0 and at + 6 < len(data):
        size = struct.unpack_from("<H", data, at + 2)[0]
        if (
            at + size + 2 > len(data)
            or sum(data[at : at + size]) & 0xFFFF != struct.unpack_from("<H", data, at + size)[0]
        ):
            at += 1
            continue
        offsets = struct.unpack_from(f"<{data[at + 5]}H", data, at + 6)
        parts = {struct.unpack_from("<H", data, at + offset)[0]: at + offset for offset in offsets}
        year, month, day, hour, minute, second, hundredth = data[
            parts[VARIABLE_LEADER] + 4 : parts[VARIABLE_LEADER] + 11
        ]
        stamp = datetime(2000 + year, month, day, hour, minute, second, 10_000 * hundredth, tzinfo=UTC)
        times.append(stamp.timestamp())
        # Ranges to the bottom stand 16 bytes into the bottom-track data, 0 for none.
        bottom = parts.get(BOTTOM_TRACK)
        ranges = (0, 0, 0, 0) if bottom is None else struct.unpack_from("<4H", data, bottom + 16)
        beams.append("".join("1" if value else "0" for value in ranges))
        at += size + 2
    return [round(time - times[0], 2) for time in times], beams


def main() -> None:
    """Writes the file."""
    times, beams = pattern()
    lines = [
        "# Written by tools/bench_recorded.py from recordings that may be republished; licences stand beside them.",
        "",
        "[noise]",
        "# Closure residuals of a Teledyne RiverPro over a moving river bed, over their half-width of 68.3 %.",
        'source = "data/logs/pd0_riverpro/RiverPro_test01.PD0, MHKiT-Python, BSD-3"',
        f"residuals = {noise()}",
        "",
        "[loss]",
        "# Beams of a Teledyne Explorer on a Slocum glider that met the bottom, ensemble by ensemble, beam 1 first.",
        'source = "data/logs/pd0_glider/LA100204.PD0, ooici/marine-integrations, BSD-2 style"',
        f"time_s = {times}",
        f"beams = {beams}".replace("'", '"'),
        "",
    ]
    write_text(OUT, "\n".join(lines))
    write_text(OUT.with_name("riverpro.csv"), pings())
    licence = ROOT / "data" / "logs" / "pd0_riverpro" / "LICENSE.md"
    write_text(OUT.with_name("riverpro_license.md"), licence.read_text(encoding="utf-8"))


if __name__ == "__main__":
    main()
