"""Take the pictures of real pages that the documentation shows, in both schemes: docs/figures/page_*.png.

    python -m tools.site_screenshots              # all; a minute and a half
    python -m tools.site_screenshots replay audit # some

The pages are made from what ships with the sources: the simulated survey, the log of a river profiler, `live-demo`,
and a simulated DVL that has lost two beams. Chromium draws them.
"""

from __future__ import annotations

import contextlib
import io
import json
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from http.client import HTTPConnection
from pathlib import Path
from typing import Any, Literal

import cyclopts
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
port = [
  {{ port = "microstrain", to = "udpout:127.0.0.1:{free}" }},
  {{ port = "sentence", to = "udpout:127.0.0.1:{free}" }},
  {{ port = "odometry", to = "udpout:127.0.0.1:{free}", settings = {{ receiver = "px4" }} }},
  {{ port = "waterlinked_json", to = "udpout:127.0.0.1:{free}" }},
]
"""
"""Four receivers of a DVL with two beams and no IMU."""


BOTTOMLOCK = [sys.executable, "-m", "bottomlock"]


def run(folder: Path, *words: str) -> None:
    """Runs a command of bottomlock in a folder."""
    subprocess.run([*BOTTOMLOCK, *words], check=True, cwd=folder, stdout=subprocess.DEVNULL)  # noqa: S603 - our own arguments


@contextlib.contextmanager
def running(*words: str) -> Iterator[None]:
    """A command of bottomlock that runs meanwhile."""
    process = subprocess.Popen([*BOTTOMLOCK, *words], stdout=subprocess.DEVNULL)  # noqa: S603 - ours
    try:
        yield
    finally:
        process.terminate()
        process.wait()


def wait_for(port: int, ready: Callable[[dict[str, Any]], bool], within_s: float = 60.0) -> str:
    """Waits until the state behind a health page is as it is wanted; the address of the page.

    Raises:
        TimeoutError: where it does not become so.
    """
    ends = time.monotonic() + within_s
    while time.monotonic() < ends:
        with contextlib.suppress(OSError), contextlib.closing(HTTPConnection("127.0.0.1", port, 2.0)) as page:
            page.request("GET", "/health")
            if ready(json.load(page.getresponse())):
                return f"http://127.0.0.1:{port}/"
        time.sleep(0.2)
    raise TimeoutError(f"the page of port {port} is not as it is wanted after {within_s:g} s")


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
        yield wait_for(
            port, lambda health: [one["used"] for one in health["beams"]] == [True, True, False, False]
        )


@contextlib.contextmanager
def sending(folder: Path) -> Iterator[str]:
    """The health page of four receivers, of which two get what two beams determine."""
    dvl, page = (free_port(socket.SOCK_STREAM) for _ in range(2))
    configuration = folder / "ports.toml"
    places = PORTS.format(dvl=dvl, page=page, free=free_port(socket.SOCK_DGRAM))
    configuration.write_text(places, encoding="utf-8")
    run(folder, "list", "scenarios", "--copy", "straight", "--out", "two_beams.toml")
    scenario = folder / "two_beams.toml"
    lost = "\n[[dvl.outages]]\nbeams = [3, 4]\nfrom_s = 5.0\nto_s = 250.0\n"
    whole = scenario.read_text(encoding="utf-8").replace("beams_lost = [3, 4]", "")
    scenario.write_text(whole + lost, encoding="utf-8")
    source = ("simulate-dvl", str(scenario), "--dvl", f"tcpin:127.0.0.1:{dvl}")
    with running(*source), running("live", str(configuration)):
        yield wait_for(page, lambda health: health["state"] == "PARTIAL" and health["ports"][0]["sent"] > 10)


SHOTS: dict[str, tuple[Pages, int, int]] = {
    "replay": (replayed, 1200, 1450),
    "audit": (audited, 1000, 670),
    "live": (navigating, 820, 1100),
    "ports": (sending, 820, 1100),
}
"""What gives the address of a page, made in a folder, while it stands; width and height of the window, CSS pixels."""


def taken(page: str, width: int, height: int, *, dark: bool) -> Image.Image:
    """The page as the browser draws it, without what is empty at its end."""
    with Browser() as browser:
        browser.size(width, height)
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


def main(*names: Literal["replay", "audit", "live", "ports"], out: Path = FOLDER) -> None:
    """Take the pictures of real pages that the documentation shows: those named, or all."""
    for name in names or SHOTS:
        made, width, height = SHOTS[name]
        with tempfile.TemporaryDirectory() as folder, made(Path(folder)) as page:
            for scheme in ("light", "dark"):
                data = png(taken(page, width, height, dark=scheme == "dark"))
                write_bytes(out / f"page_{name}_{scheme}.png", data)
                print(f"page_{name}_{scheme}.png: {len(data) / 1000:.0f} kB", flush=True)


if __name__ == "__main__":
    cyclopts.run(main)
