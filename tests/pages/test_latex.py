"""Tables in LaTeX: a compiler takes them, and the text of its PDF is that of the page."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from bottomlock.pages.latex import latex_table, latex_text
from bottomlock.pages.page import Table

AWKWARD = Table(
    ["Method", "σ, m/s²", "% DT", "[1]"],
    [
        ["`sway_current`", "0.12 (0.1 … 0.2)", "−2.3×10⁻⁶", "[a]"],
        ["a & b # {c} $d ~ e^f \\g", "±3°", "<br>", "–"],
        ["", "1", "2", "[b]"],
    ],
    "Errors at the end\nin **% of** `distance_m`.",
    left=2,
)


def test_no_sign_of_latex_is_left_as_it_is() -> None:
    """Each escape by hand, from the list of special characters of the LaTeX Companion."""
    assert latex_text(r"\&%$#_{}~^") == (r"\textbackslash{}\&\%\$\#\_\{\}\textasciitilde{}\textasciicircum{}")


def test_a_table_is_one_tabular_with_a_comment() -> None:
    lines = latex_table(AWKWARD).splitlines()
    assert lines[0] == "% Errors at the end in % of distance_m."
    assert lines[1] == r"\begin{tabular}{llrr}"
    rows = [line for line in lines if line.endswith(r"\\")]
    assert len(rows) == 4
    assert [len(re.findall(r"(?<!\\)&", row)) for row in rows] == [3] * 4
    # After \\ a bracket would be an argument.
    assert not any(row.lstrip().startswith("[") for row in lines)


@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="no pdflatex (apt install texlive-latex-base)")
def test_a_compiler_takes_it(tmp_path: Path) -> None:
    """PdfTeX stops at the first error; booktabs stands in where the distribution lacks it."""
    plain = r"\let\toprule\hline\let\midrule\hline\let\bottomrule\hline"
    rules = rf"\IfFileExists{{booktabs.sty}}{{\usepackage{{booktabs}}}}{{{plain}}}"
    (tmp_path / "a.tex").write_text(
        rf"\documentclass{{article}}{rules}\begin{{document}}{latex_table(AWKWARD)}\end{{document}}".replace(
            r"\begin{document}%", "\\begin{document}\n%"
        ),
        encoding="utf-8",
    )
    run = subprocess.run(
        ["pdflatex", "-halt-on-error", "-interaction=nonstopmode", "a.tex"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stdout[-2000:]
    assert (tmp_path / "a.pdf").stat().st_size > 5000
