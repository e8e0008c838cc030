"""What the figures of a page have in common stands in it once: outlines of letters, and styles; ids are short."""

import re

_PICTURE = re.compile(r'<svg role="img".*?</svg>', re.DOTALL)
_GLYPH = re.compile(r'<path id="[\w-]+?-(DejaVu[\w.-]+)"(.*?)/>')
_GLYPH_USE = re.compile(r'href="#[\w-]+?-(DejaVu[\w.-]+)"')
_ID = re.compile(r'(?<= id=")[\w-]+')
_USE = re.compile(r'(?<=href="#)[\w-]+|(?<=url\(#)[\w-]+')
_STYLE = re.compile(r' style="([^"]*)"')
_OWN_SHEET = re.compile(r"<style[^>]*>.*?</style>", re.DOTALL)


def share_svg(page: str) -> str:
    """A page whose figures refer to one set of letters and to classes in place of styles, by numbers in place of names.

    A page without figures stays as it is.
    """
    pictures = _PICTURE.findall(page)
    if not pictures:
        return page
    outlines: dict[str, str] = {}
    for picture in pictures:
        outlines |= dict(_GLYPH.findall(picture))
    own = dict.fromkeys(one for picture in pictures for one in _ID.findall(_GLYPH.sub("", picture)))
    # No name of a part of a page has a dot.
    letters = {glyph: f".{k}" for k, glyph in enumerate(outlines)}
    ids = {one: f".{k}" for k, one in enumerate(own, start=len(letters))}
    words = dict.fromkeys(style for picture in pictures for style in _STYLE.findall(picture))
    styles = {style: f"s{k}" for k, style in enumerate(words)}
    sheets = dict.fromkeys(sheet for picture in pictures for sheet in _OWN_SHEET.findall(picture))

    def shared(found: re.Match[str]) -> str:
        text = _OWN_SHEET.sub("", _GLYPH.sub("", found[0]))
        text = _GLYPH_USE.sub(lambda use: f'href="#{letters[use[1]]}"', text)
        text = _USE.sub(lambda use: ids[use[0]], _ID.sub(lambda one: ids[one[0]], text))
        text = _STYLE.sub(lambda style: f' class="{styles[style[1]]}"', text)
        return text.replace("<defs></defs>", "")

    defined = "".join(f'<path id="{letters[glyph]}"{outlines[glyph]}/>' for glyph in outlines)
    rules = "\n".join(f".{name} {{ {style} }}" for style, name in styles.items())
    common = f'<svg class="shared" aria-hidden="true" width="0" height="0"><defs>{defined}</defs></svg>'
    page = _PICTURE.sub(shared, page)
    page = page.replace("</head>", f"{''.join(sheets)}\n<style>\n{rules}\n</style>\n</head>", 1)
    return page.replace("</header>", f"</header>\n{common}", 1)
