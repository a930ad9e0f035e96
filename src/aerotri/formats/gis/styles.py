"""How QGIS draws the layers (QML): black and grey, told apart by shape, size and dashes, readable in print."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape

BLACK, GREY, WHITE, CLEAR = "0,0,0,255", "120,120,120,255", "255,255,255,255", "0,0,0,0"
HEAD = "<!DOCTYPE qgis PUBLIC 'http://mrcc.com/qgis.dtd' 'SYSTEM'>\n"
MARKER, LINE, FILL = "marker", "line", "fill"
EXPRESSION = 3
"""Kind of a property of QGIS that follows an expression."""
LABELS = {MARKER: 0, LINE: 2, FILL: 1}
"""Where QGIS puts labels: around a point, along a line, over a polygon."""


@dataclass(frozen=True)
class Rule:
    """Features of one kind and their symbol.

    Parameters
    ----------
    label : in the legend. filter : expression of QGIS, '' for all features. shape : MARKER, LINE or FILL.
    properties : of the symbol by QGIS' names, mm and r,g,b,a. size : expression for the size of a marker.
    arrow : a head at the end of a line.
    """

    label: str
    filter: str
    shape: str
    properties: Mapping[str, str]
    size: str = ""
    arrow: bool = False


@dataclass(frozen=True)
class Style:
    """Rules of a layer, the first that fits counts on top; label : the column written beside features, '' for none."""

    rules: Sequence[Rule]
    label: str = ""


def marker(
    label: str, rule: str, name: str, size: float, filled: bool = True, by: str = "", grey: bool = False
) -> Rule:
    """Points: a shape of QGIS ('circle', 'triangle', 'cross2' …), mm, filled or hollow; `by` gives the size."""
    ink = GREY if grey else BLACK
    properties = {
        "name": name, "size": f"{size:g}", "color": ink if filled else WHITE, "outline_color": ink,
        "outline_width": "0.3", "size_unit": "MM", "outline_width_unit": "MM",
    }  # fmt: skip
    return Rule(label, rule, MARKER, properties, by)


def line(label: str, rule: str, width: float, style: str = "solid", grey: bool = False, arrow: bool = False) -> Rule:
    """Lines: width in mm, 'solid', 'dash' or 'dot', with a head at the end or without."""
    properties = {
        "line_color": GREY if grey else BLACK, "line_width": f"{width:g}", "line_style": style,
        "line_width_unit": "MM", "capstyle": "flat",
    }  # fmt: skip
    return Rule(label, rule, LINE, properties, arrow=arrow)


def outline(label: str, rule: str, width: float, style: str = "solid", grey: bool = False) -> Rule:
    """Polygons: their edge alone."""
    properties = {
        "color": CLEAR, "style": "no", "outline_color": GREY if grey else BLACK, "outline_width": f"{width:g}",
        "outline_style": style, "outline_width_unit": "MM",
    }  # fmt: skip
    return Rule(label, rule, FILL, properties)


TIE, CONTROL, CHECK = "\"role\" = 'tie'", "\"role\" = 'control'", "\"role\" = 'check'"
PLAN, HEIGHT = "\"component\" = 'plan'", "\"component\" = 'height'"
STYLES = {
    "footprints": Style(
        (outline("photograph", 'NOT "is_cut"', 0.2, grey=True),
         outline("sees the horizon, cut", '"is_cut"', 0.3, "dash")),
    ),
    "projection_centres": Style(
        (marker("projection centre", "\"status\" = 'used'", "circle", 1.4),), "image",
    ),
    "strips": Style((line("strip", "", 0.35, grey=True, arrow=True),), "strip"),
    "points": Style(
        (marker("tie point", f'{TIE} AND "rays" > 2', "circle", 0.7, grey=True),
         marker("tie point of two rays", f'{TIE} AND "rays" <= 2', "cross2", 1.2),
         marker("control point", CONTROL, "triangle", 3.2),
         marker("check point", CHECK, "circle", 2.8, filled=False)),
    ),
    "error_ellipses": Style((outline("error ellipse, enlarged", "", 0.25),)),
    "control_vectors": Style(
        (line("plan, enlarged", PLAN, 0.5, arrow=True), line("height, enlarged", HEIGHT, 0.4, "dash", arrow=True)),
        "point",
    ),
    "check_vectors": Style(
        (line("plan, enlarged", PLAN, 0.3, arrow=True), line("height, enlarged", HEIGHT, 0.25, "dot", arrow=True)),
        "point",
    ),
    "largest_residuals": Style(
        (marker("beyond the limit", '"beyond_limit"', "cross2", 2.5, by='1.5 + 3 * min(abs("w") / "limit", 4) / 4'),
         marker("within the limit", 'NOT "beyond_limit"', "circle", 1.4, filled=False)),
    ),
    "work_list": Style(
        (marker("wrong", "\"level\" = 'wrong'", "diamond", 4.5),
         marker("weak", "\"level\" = 'weak'", "diamond", 4.5, filled=False),
         marker("doubtful", "\"level\" = 'doubtful'", "square", 3.0, filled=False)),
        "kind",
    ),
}  # fmt: skip
"""The style of every layer by its name."""


LABEL_MM = 15.0
"""Between things that are named, on the screen or on paper [C]: the name of a photograph is about as long."""


def qml(style: Style, spacing: float | None = None) -> str:
    """A style as QGIS reads it from the table layer_styles.

    Parameters
    ----------
    spacing : m between the features, which are named on maps where it is `LABEL_MM` or more; None: on every map.
    """
    rules = "".join(
        f'<rule key="{number}" symbol="{number}" label="{escape(rule.label)}"{_filter(rule)}/>'
        for number, rule in enumerate(style.rules)
    )
    symbols = "".join(_symbol(str(number), rule) for number, rule in enumerate(style.rules))
    shape = style.rules[0].shape
    kind = (MARKER, LINE, FILL).index(shape)
    return (
        f'{HEAD}<qgis version="3.22" styleCategories="Symbology|Labeling" labelsEnabled="{int(bool(style.label))}">'
        f'<renderer-v2 type="RuleRenderer" symbollevels="0" enableorderby="0" forceraster="0">'
        f'<rules key="all">{rules}</rules><symbols>{symbols}</symbols></renderer-v2>'
        f"{_labels(style.label, shape, spacing)}<layerGeometryType>{kind}</layerGeometryType></qgis>"
    )


def _filter(rule: Rule) -> str:
    return f' filter="{escape(rule.filter)}"' if rule.filter else ""


def _symbol(name: str, rule: Rule) -> str:
    kinds = {MARKER: "SimpleMarker", LINE: "SimpleLine", FILL: "SimpleFill"}
    layers = _layer(kinds[rule.shape], rule.properties, rule.size)
    if rule.arrow:
        layers += _head(name, rule.properties)
    return f'<symbol name="{name}" type="{rule.shape}" alpha="1" clip_to_extent="1" force_rhr="0">{layers}</symbol>'


def _layer(kind: str, properties: Mapping[str, str], size: str = "", below: str = "") -> str:
    """A layer of a symbol; its properties twice, as QGIS before 3.18 and after has them."""
    options = "".join(f'<Option name="{k}" value="{escape(v)}" type="QString"/>' for k, v in properties.items())
    props = "".join(f'<prop k="{k}" v="{escape(v)}"/>' for k, v in properties.items())
    follows = _following(size) if size else ""
    return (
        f'<layer class="{kind}" enabled="1" locked="0" pass="0"><Option type="Map">{options}</Option>{props}'
        f"{follows}{below}</layer>"
    )


def _following(size: str) -> str:
    """A size that follows an expression."""
    return (
        '<data_defined_properties><Option type="Map"><Option name="name" value="" type="QString"/>'
        '<Option name="properties" type="Map"><Option name="size" type="Map">'
        '<Option name="active" value="true" type="bool"/>'
        f'<Option name="expression" value="{escape(size)}" type="QString"/>'
        f'<Option name="type" value="{EXPRESSION}" type="int"/></Option></Option>'
        '<Option name="type" value="collection" type="QString"/></Option></data_defined_properties>'
    )


def _head(name: str, properties: Mapping[str, str]) -> str:
    """An arrow head at the last vertex of a line."""
    ink = properties["line_color"]
    head = {
        "name": "filled_arrowhead", "color": ink, "outline_color": ink, "outline_style": "no", "size": "2.2",
        "size_unit": "MM",
    }  # fmt: skip
    symbol = (
        f'<symbol name="@{name}@1" type="marker" alpha="1" clip_to_extent="1" force_rhr="0">'
        f"{_layer('SimpleMarker', head)}</symbol>"
    )
    return _layer("MarkerLine", {"placement": "lastvertex", "placements": "LastVertex", "rotate": "1"}, below=symbol)


def _labels(column: str, shape: str, spacing: float | None) -> str:
    if not column:
        return ""
    limit = "" if spacing is None else f' scaleVisibility="1" scaleMin="0" scaleMax="{1e3 * spacing / LABEL_MM:.0f}"'
    return (
        f'<labeling type="simple"><settings><text-style fieldName="{escape(column)}" isExpression="0" fontSize="7"'
        f' fontSizeUnit="Point" textColor="{BLACK}" textOpacity="1"><text-buffer bufferDraw="1" bufferSize="0.6"'
        f' bufferSizeUnits="MM" bufferColor="{WHITE}" bufferOpacity="1"/></text-style>'
        f'<placement placement="{LABELS[shape]}" dist="0.8" distUnits="MM" priority="5"/>'
        '<rendering drawLabels="1" displayAll="0" obstacle="1"' + limit + "/></settings></labeling>"
    )
