"""Take the pictures of real pages that the documentation shows, in both schemes: docs/figures/page_*.png.

    python -m tools.site_screenshots              # all; a minute and a half
    python -m tools.site_screenshots replay audit # some

The pages are made from what ships with the sources: the simulated survey, the log of a river profiler, `live-demo`,
and a simulated DVL that has lost two beams. Chromium draws them.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import re
import socket
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from PIL import Image, ImageChops

from bottomlock.files.atomic_write import write_bytes
from tests.browser import Browser
from tests.live.processes import free_port

ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / "docs" / "figures"
LOGS = ROOT / "data" / "logs"
COLOURS, MARGIN_PX = 256, 24
DRAWN_S = 3.0
"""Until the scripts of a page have drawn, and a live page has had its first states."""

Pages = Callable[[Path], contextlib.AbstractContextManager[str]]

PORTS = """
name = "two_beams"
mode = "velocity"
dvl = {{ geometry = "x_janus_20", beam_noise_mps = 0.042 }}
source = [{{ name = "dvl", address = "tcp:127.0.0.1:{dvl}", format = "waterlinked-json", rate_hz = 1 }}]
health = {{ port = {page} }}

[[port]]
port = "microstrain"
to = "udpout:127.0.0.1:{free}"

[[port]]
port = "sentence"
to = "udpout:127.0.0.1:{free}"

[[port]]
port = "odometry"
to = "udpout:127.0.0.1:{free}"
settings.receiver = "px4"

[[port]]
port = "waterlinked_json"
to = "udpout:127.0.0.1:{free}"
"""
"""Four receivers of a DVL with two beams and no IMU."""


@dataclass(frozen=True)
class Shot:
    """A page, and how much of it is shown.

    Attributes:
        page: gives the address of the page, made in a folder, while it stands.
        width_px: of the window.
        height_px: of the window; what is empty below is cut off.
    """

    page: Pages
    width_px: int
    height_px: int


def command(*words: str) -> list[str]:
    """A command of bottomlock by this Python."""
    return [sys.executable, "-m", "bottomlock", *words]


def run(folder: Path, *words: str) -> None:
    """Runs a command of bottomlock in a folder."""
    subprocess.run(command(*words), check=True, cwd=folder, stdout=subprocess.DEVNULL)  # noqa: S603 - our own arguments


@contextlib.contextmanager
def running(*words: str) -> Iterator[None]:
    """A command of bottomlock that runs meanwhile."""
    process = subprocess.Popen(command(*words), stdout=subprocess.DEVNULL)  # noqa: S603 - ours
    try:
        yield
    finally:
        process.terminate()
        process.wait()


def wait_for(page: str, ready: Callable[[dict[str, Any]], bool], within_s: float = 60.0) -> None:
    """Waits until the state behind a health page is as it is wanted.

    Raises:
        TimeoutError: where it does not become so.
    """
    ends = time.monotonic() + within_s
    while time.monotonic() < ends:
        with contextlib.suppress(OSError):
            try:
                answer = urllib.request.urlopen(f"{page}health", timeout=2.0)  # noqa: S310 - on this machine
            except urllib.error.HTTPError as unavailable:
                answer = unavailable
            with answer:
                if ready(json.load(answer)):
                    return
        time.sleep(0.2)
    raise TimeoutError(f"{page} is not as it is wanted after {within_s:g} s")


@contextlib.contextmanager
def replayed(folder: Path) -> Iterator[str]:
    """The page of a replay: whether it can be trusted, and the dive."""
    run(folder, "replay", str(LOGS / "survey_dive" / "case.toml"), "--out", "dive")
    yield (folder / "dive" / "report.html").as_uri()


@contextlib.contextmanager
def audited(folder: Path) -> Iterator[str]:
    """The findings of the worked example, whose geometry is the wrong one."""
    run(folder, "convert", str(LOGS / "pd0_riverpro" / "RiverPro_test01.PD0"), "--out", "river.parquet")
    run(folder, "audit", "river.parquet", "--geometry", "x_janus_20", "--out", "audit")
    yield (folder / "audit" / "audit.html").as_uri()


@contextlib.contextmanager
def navigating(_: Path) -> Iterator[str]:
    """The health page of a navigation that has lost two beams."""
    port = free_port(socket.SOCK_STREAM)
    with running("live-demo", "--seconds", "60", "--page-port", str(port)):
        page = f"http://127.0.0.1:{port}/"
        wait_for(page, lambda health: [one["used"] for one in health["beams"]] == [True, True, False, False])
        yield page


@contextlib.contextmanager
def sending(folder: Path) -> Iterator[str]:
    """The health page of four receivers, of which two get what two beams determine."""
    dvl, page, free = (
        free_port(kind) for kind in (socket.SOCK_STREAM, socket.SOCK_STREAM, socket.SOCK_DGRAM)
    )
    places = {"dvl": dvl, "page": page, "free": free}
    configuration = folder / "ports.toml"
    configuration.write_text(PORTS.format(**places), encoding="utf-8")
    run(folder, "list", "scenarios", "--copy", "straight", "--out", "two_beams.toml")
    scenario = (folder / "two_beams.toml").read_text(encoding="utf-8")
    lost = "[[dvl.outages]]\nbeams = [3, 4]\nfrom_s = 5.0\nto_s = 250.0\n"
    (folder / "two_beams.toml").write_text(
        re.sub(r"^beams_lost = .*\n", "", scenario, flags=re.MULTILINE) + lost
    )
    source = (str(folder / "two_beams.toml"), "--dvl", f"tcpin:127.0.0.1:{places['dvl']}")
    with running("simulate-dvl", *source), running("live", str(configuration)):
        address = f"http://127.0.0.1:{places['page']}/"
        wait_for(address, lambda health: health["state"] == "PARTIAL" and health["ports"][0]["sent"] > 10)
        yield address


SHOTS = {
    "replay": Shot(replayed, 1200, 1450),
    "audit": Shot(audited, 1000, 670),
    "live": Shot(navigating, 820, 1100),
    "ports": Shot(sending, 820, 1100),
}


def taken(page: str, shot: Shot, *, dark: bool) -> Image.Image:
    """The page as the browser draws it, without what is empty at its end."""
    with Browser() as browser:
        browser.size(shot.width_px, shot.height_px)
        browser.media(dark=dark)
        browser.open(page)
        time.sleep(DRAWN_S)
        image = Image.open(io.BytesIO(browser.picture())).convert("RGB")
    paper = Image.new("RGB", image.size, image.getpixel((0, image.height - 1)))
    drawn = ImageChops.difference(image, paper).getbbox()
    return image.crop((0, 0, image.width, min(image.height, drawn[3] + MARGIN_PX))) if drawn else image


def png(image: Image.Image) -> bytes:
    """The image with few colours."""
    buffer = io.BytesIO()
    image.quantize(COLOURS, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE).save(
        buffer, "png", optimize=True
    )
    return buffer.getvalue()


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(SHOTS)}; all by default")
    parser.add_argument("--out", type=Path, default=FOLDER)
    asked = parser.parse_args()
    unknown = [name for name in asked.names if name not in SHOTS]
    if unknown:
        parser.error(f"{unknown[0]}: no page; there are {', '.join(SHOTS)}")
    for name in asked.names or SHOTS:
        shot = SHOTS[name]
        with tempfile.TemporaryDirectory() as folder, shot.page(Path(folder)) as page:
            for scheme in ("light", "dark"):
                data = png(taken(page, shot, dark=scheme == "dark"))
                write_bytes(asked.out / f"page_{name}_{scheme}.png", data)
                print(f"page_{name}_{scheme}.png: {len(data) / 1000:.0f} kB", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
