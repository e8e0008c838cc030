"""A table of a page in LaTeX, for a paper."""

import re

from bottomlock.pages.page import Table, plain_text

_ESCAPED = {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    **{sign: rf"\{sign}" for sign in "&%$#_{}"},
    "–": "--",
    "…": r"\ldots{}",
    "−": "$-$",
    "×": r"$\times$",
    "±": r"$\pm$",
    "σ": r"$\sigma$",
    "°": r"$^\circ$",
    "²": "$^2$",
    "†": r"\dag{}",
    "<": "$<$",
    ">": "$>$",
}
_RAISED = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")


def latex_text(text: str) -> str:
    r"""A text without its marks as LaTeX shows it; what has no sign of its own there stays as it is.

    >>> latex_text("sway_current, 95 %"), latex_text("−2.3×10⁻⁶ m"), latex_text("σ of `tc` & °")
    ('sway\\_current, 95 \\%', '$-$2.3$\\times 10^{-6}$ m', '$\\sigma$ of tc \\& $^\\circ$')
    """
    pieces = re.split(r"(×10[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)", plain_text(text))
    return "".join(
        rf"$\times 10^{{{piece[3:].translate(_RAISED)}}}$"
        if place % 2
        else "".join(_ESCAPED.get(letter, letter) for letter in piece)
        for place, piece in enumerate(pieces)
    )


def latex_table(table: Table) -> str:
    r"""A `tabular` with the rules of the package booktabs, its caption as a comment above.

    >>> print(latex_table(Table(["Method", "End, m"], [["`sway_current`", "1.4"]], "At the end.")), end="")
    % At the end.
    \begin{tabular}{lr}
    \toprule
    Method & End, m \\
    \midrule
    sway\_current & 1.4 \\
    \bottomrule
    \end{tabular}
    """

    def line(cells: list[str]) -> str:
        # A bracket after the end of a line would be the space below it.
        return " & ".join(f"{{{cell}}}" if cell.startswith("[") else cell for cell in cells) + r" \\"

    columns = "".join("l" if place < table.left else "r" for place in range(len(table.columns)))
    lines = [
        *([f"% {' '.join(plain_text(table.caption).split())}"] if table.caption else []),
        rf"\begin{{tabular}}{{{columns}}}",
        r"\toprule",
        line([latex_text(name) for name in table.columns]),
        r"\midrule",
        *(line([latex_text(cell) for cell in row]) for row in table.rows),
        r"\bottomrule",
        r"\end{tabular}",
    ]
    return "\n".join(lines) + "\n"
