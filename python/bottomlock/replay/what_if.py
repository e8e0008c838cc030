"""Beam losses of a what-if case: beams lost, outages, Markov chains and the validity of another recording."""

import numpy as np

from bottomlock.errors import DataError
from bottomlock.io.beams import read_beams, read_geometry
from bottomlock.plant import beam_loss
from bottomlock.recordings.streams import Flags, Floats, Times
from bottomlock.replay.dvl_sections import BeamRecording, WhatIf
from bottomlock.replay.random_errors import case_key


def beams_returned(
    what_if: WhatIf, time_ns: Times, beams: int, *, start_ns: int, name: str, seed: int, run: int
) -> Flags:
    """(E, B) validity of the beams at each ping, by every rule of a what-if case.

    Args:
        what_if: the section of the case file.
        time_ns: (E,) times of the pings, from the start of the navigation on.
        beams: number of beams of the instrument.
        start_ns: start of the navigation, from which the section's seconds count.
        name: name of the case; with seed, run and beam it keys the random draws.
        seed: seed of the case.
        run: number of the run.

    Raises:
        DataError: for a beam that does not exist, and a recording that cannot be read or has another number of beams.
    """
    for beam in what_if.beams_named:
        if beam > beams:
            raise DataError(f"what_if '{what_if.name}': beam {beam} does not exist, expected 1 to {beams}")
    since_ns = time_ns - start_ns
    outages = [beam_loss.Outage(outage.beams, outage.from_s, outage.to_s) for outage in what_if.outages]
    throughout = beam_loss.Outage(what_if.beams_lost, 0.0, float("inf"))
    rules = [beam_loss.scheduled(since_ns, beams, [throughout, *outages])]
    # Each what-if case draws from its own streams: their losses are independent of one another.
    keys = {"seed": seed, "trajectory_key": case_key(f"{name}/{what_if.name}"), "first_run": run, "runs": 1}
    if what_if.dropouts:
        chains = {
            beam: beam_loss.MarkovDropout(dropout.mean_up_s, dropout.mean_down_s)
            for dropout in what_if.dropouts
            for beam in dropout.beams
        }
        each = [chains.get(beam + 1) for beam in range(beams)]
        rules.append(beam_loss.markov_valid(since_ns, each, **keys)[0])
    if what_if.altitude_loss is not None:
        chain = beam_loss.MarkovDropout(what_if.altitude_loss.mean_up_s, what_if.altitude_loss.mean_down_s)
        rules.append(beam_loss.altitude_loss(since_ns, beams, chain, **keys)[0])
    if what_if.validity_of is not None:
        rules.append(_pattern(what_if.validity_of, what_if.validity_from_s, since_ns, beams))
    return beam_loss.combine(*rules)


def _pattern(of: BeamRecording, from_s: float, since_ns: Times, beams: int) -> Flags:
    stamps, _, valid = read_beam_recording(of)
    if valid.shape[1] != beams:
        raise DataError(f"{of.file}: has {valid.shape[1]} beams, expected the recording's {beams}")
    rest = stamps >= stamps[0] + round(from_s * 1e9)
    if rest.sum() < 2:
        raise DataError(f"{of.file}: ends before validity_from_s = {from_s:g} s")
    return beam_loss.replayed(since_ns, stamps[rest], valid[rest])


def read_beam_recording(of: BeamRecording) -> tuple[Times, Floats, Flags]:
    """Times (n,), velocities and validity (n, B) of another recording's beams.

    Raises:
        ScenarioError, DataError: as `read_geometry` and `read_beams`.
    """
    instrument = read_geometry(of.geometry)
    pings = read_beams(of.file, geometry=instrument)
    return pings.time_ns, pings.velocity_mps, np.asarray(pings.valid)
