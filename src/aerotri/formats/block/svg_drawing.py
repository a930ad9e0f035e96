"""Whether an SVG file is a drawing and nothing else: no program in it, nothing outside of it, no growth without bound.

What is allowed is listed, as what programs hide in drawings cannot be [L: SVG 2, sections 2.7 and 5.14].
"""

from __future__ import annotations

import re
from xml.etree.ElementTree import Element

SVG = "http://www.w3.org/2000/svg"
XHTML = "http://www.w3.org/1999/xhtml"
NAMES = """
svg g defs symbol use title desc metadata switch view path rect circle ellipse line polyline polygon text tspan tref
textPath image style linearGradient radialGradient meshgradient meshrow meshpatch stop pattern clipPath mask marker
filter solidcolor hatch hatchpath color-profile feBlend feColorMatrix feComponentTransfer feComposite feConvolveMatrix
feDiffuseLighting feDisplacementMap feDistantLight feDropShadow feFlood feFuncA feFuncB feFuncG feFuncR feGaussianBlur
feImage feMerge feMergeNode feMorphology feOffset fePointLight feSpecularLighting feSpotLight feTile feTurbulence font
font-face glyph missing-glyph hkern vkern
"""
DRAWN = frozenset(NAMES.split())
"""Elements that draw, or say how."""
IN_ITSELF = re.compile(r"#[^\s]*|data:image/(?:png|jpe?g|gif|webp);", re.IGNORECASE)
"""What a reference may lead to: the drawing itself, or a picture that it holds."""
REFERENCES = ("href", "src", "base")
ADDRESS = re.compile(r"url\s*\(\s*[\"']?\s*(?!#|data:image/(?:png|jpe?g|gif|webp);)", re.IGNORECASE)
OF_STYLES = re.compile(
    r"\\|@(?:import|charset|namespace|font-face)|(?:image|image-set|src|cross-fade|element|expression)\s*\("
    r"|javascript:|-moz-binding|behavior\s*:",
    re.IGNORECASE,
)
"""In styles: what loads files or runs programs, and the backslash by which such words are hidden."""
PROGRAM = re.compile(r"\s*(?:java|vb|live)script\s*:", re.IGNORECASE)
MOST_DRAWN = 100_000
"""Elements that are drawn at most, repeated ones counted each time [C]: any logo has fewer."""
DEEPEST = 100
"""Elements within elements at most [C]."""


def fault_of_drawing(root: Element) -> str:
    """What is in a drawing that does not belong there, in words that follow on its name; '' where it is a drawing."""
    for element in root.iter():
        fault = _fault(element)
        if fault:
            return fault
    return _fault_of_size(root)


def _fault(element: Element) -> str:
    space, _, name = element.tag.rpartition("}")
    if space.lstrip("{") in ("", SVG) and name not in DRAWN:
        return f"contains <{name[:40]}>, which is no part of a drawing"
    if space.lstrip("{") == XHTML or name.lower() in ("script", "foreignobject"):
        return f"contains <{name[:40]}>, which is no part of a drawing"
    for key, value in element.attrib.items():
        fault = _fault_of_attribute(key.rpartition("}")[2].lower(), value)
        if fault:
            return fault
    return _fault_of_style(element.text or "") if name == "style" else ""


def _fault_of_attribute(name: str, value: str) -> str:
    plain = "".join(c for c in value if c.isprintable()).strip()
    if name.startswith("on"):
        return f"has the event attribute {name[:40]}"
    if name in REFERENCES and not IN_ITSELF.match(plain):
        return "refers to other files" if not PROGRAM.match(plain) else "contains a program"
    if PROGRAM.match(plain):
        return "contains a program"
    if name == "style":
        return _fault_of_style(value)
    return "refers to other files" if ADDRESS.search(value) else ""


def _fault_of_style(text: str) -> str:
    found = OF_STYLES.search(text)
    if found:
        return f"has a style with {found[0][:20]!r}"
    return "refers to other files" if ADDRESS.search(text) else ""


def _fault_of_size(root: Element) -> str:
    """Elements too deep, used by themselves, or so often that the drawing grows without bound."""
    by_name = {value: one for one in root.iter() for key, value in one.attrib.items() if key.lower() == "id"}
    drawn: dict[Element, int] = {}
    entered: set[Element] = set()
    stack = [(root, False)]
    while stack:
        element, is_left = stack.pop()
        if element in drawn:
            continue
        parts = [*element, *_used(element, by_name)]
        if is_left:
            entered.discard(element)
            drawn[element] = 1 + sum(drawn.get(part, 1) for part in parts)
            if drawn[element] > MOST_DRAWN:
                return f"draws more than {MOST_DRAWN} elements"
            continue
        if len(entered) > DEEPEST:
            return f"has elements {DEEPEST} deep"
        entered.add(element)
        stack.append((element, True))
        for part in parts:
            if part in entered:
                return "uses itself"
            stack.append((part, False))
    return ""


def _used(element: Element, by_name: dict[str, Element]) -> list[Element]:
    """What an element draws besides its own: elements of the drawing that its references name."""
    names: list[str] = []
    for key, value in element.attrib.items():
        if key.rpartition("}")[2] == "href":
            names.append(value.strip().removeprefix("#"))
        names += re.findall(r"url\s*\(\s*[\"']?\s*#([^\s\"')]+)", value)
    return [by_name[name] for name in names if name in by_name]
