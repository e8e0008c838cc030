"""A wrong packaged geometry leads to the right one, and a right one to nothing."""

import numpy as np
import pytest

from bottomlock.audit.run import Audit
from bottomlock.io.beams import packaged_geometries, read_geometry
from bottomlock.recordings.finding import Finding
from tests.audit.synthetic import make_log

FOUR = [name for name in packaged_geometries() if read_geometry(name).geometry.beams == 4]
SQUARE = ["linkquest_caves", "linkquest_navquest", "nortek_dvl1000", "waterlinked_a50", "x_janus_20"]


def findings(seed: int, physical: str, stated: str | None, *, instrument: bool = True) -> list[Finding]:
    log = make_log(
        seed, physical=np.asarray(read_geometry(physical).geometry.directions_p), instrument=instrument
    )
    geometry = None if stated is None else read_geometry(stated).geometry
    return Audit(log, stated=geometry, geometry_name=stated).findings


@pytest.mark.first_cases(4)
@pytest.mark.parametrize("stated", FOUR)
@pytest.mark.parametrize("physical", ["waterlinked_a50", "teledyne_20"])
def test_with_the_velocity_one_geometry_is_named(physical: str, stated: str) -> None:
    found = findings(31, physical, stated)
    if stated == physical:
        assert not found
        return
    assert found[0].text == f"This is {physical}, not {stated}."
    assert f"--geometry {physical}." in found[0].hint
    assert f" with {physical}" in found[0].evidence
    assert f" with {stated}" in found[0].evidence


@pytest.mark.parametrize("physical", ["waterlinked_a50", "sontek_argonaut"])
def test_it_is_named_where_none_is_stated(physical: str) -> None:
    (first,) = findings(32, physical, None)
    assert (first.severity, first.text) == ("note", f"This is {physical}.")


def test_closure_alone_leaves_those_of_one_order() -> None:
    found = findings(33, "teledyne_30", "waterlinked_a50", instrument=False)
    assert [one.kind for one in found] == ["swapped_beams", "packaged_geometries"]
    assert found[1].text == "The beams fit the packaged geometries teledyne_20 or teledyne_30."
    assert not findings(33, "teledyne_30", "teledyne_20", instrument=False)
    assert findings(34, "x_janus_20", "teledyne_30", instrument=False)[1].text.endswith(
        f"{', '.join(SQUARE[:-1])} or {SQUARE[-1]}."
    )
