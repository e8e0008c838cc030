"""Each term is explained once, in the part in which it first stands."""

from bottomlock.pages.page import Detail, Page, Part, Table, Terms
from bottomlock.pages.pieces import EXPLANATIONS, explained


def told(page: Page) -> list[list[str]]:
    """The terms that each part explains at its end."""
    last = [part.blocks[-1] for part in explained(page).parts]
    return [
        [term for term, words in one.rows if (term in EXPLANATIONS and words == EXPLANATIONS[term][1])]
        if isinstance(one, Terms)
        else []
        for one in last
    ]


def test_terms_are_explained_where_they_first_stand() -> None:
    page = Page(
        "A dive",
        [
            Part("a", "Start", ["No term of the field."]),
            Part("b", "Beams", [Terms([("Beams", "NIS 2.2. Closure of 985 pings.")])]),
            Part("c", "Results", [Table(["Method", "% DT", "NIS"], [["`tc`", "0.1", "2.2"]])]),
            Part("d", "Code", ["```\nclosure\n```"]),
        ],
        "hands",
    )
    assert told(page) == [[], ["Closure", "NIS"], ["% DT"], []]


def test_what_is_folded_away_does_not_count() -> None:
    """A reader has not seen it; its summary has been."""
    page = Page("", [Part("a", "", [Detail("All", ["NIS"])]), Part("b", "", ["NIS"])], "")
    assert told(page) == [[], ["NIS"]]
