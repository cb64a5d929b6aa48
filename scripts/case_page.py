"""Writes docs/case-file.md, the reference of case files, from the schema that cases are checked against.

python scripts/case_page.py
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from textwrap import fill

from viscera import law
from viscera.cases import entries, material_schema, scene_schema, schema
from viscera.quantity import Choice

PAGE = Path(__file__).resolve().parent.parent / "docs" / "case-file.md"
HEAD = """# The case file

<!-- written by scripts/case_page.py from python/viscera/cases/schema.py and scene_schema.py -->

A case file is a [TOML](https://toml.io) file that describes an organ, its loads and its reduction, or a
[scene](#a-scene) of several organs. This page lists every table, key and possible value. A file with anything else in
it is refused when it is read, before any work begins. [The command line](cli.md#a-case-file) has an example of an
organ, [Supports and scenes](scenes.md#scenes-in-files) one of a scene.

- All quantities are in SI units, except the coordinates in the mesh file, whose unit is given by `units`.
- A number is written without quotes. `true`, `false` and words in quotes are never numbers, and `2.0` is not a whole
  number.
- A place is the name of a set, a list of indices such as `"3, 14, 15"`, or one or more conditions joined by `and`, such
  as `"x < 10%"`, `"20% < y < 30 mm"` or `"within 8 mm of (100, 50, 80) mm"`.
  [Units and conventions](units-and-conventions.md#places-points-and-lengths-in-words) lists all forms.
- In Python, `organ.to_case(path)` or `scene.to_case(path)` writes a case file, and `vs.case(path)` reads one.
"""
PAIRS = """
A law that lists `young` takes either `young` and `poisson`, or `mu` and `lam`. Any other built-in law takes exactly one
of those that it lists of `kappa`, `poisson` and the penalty `alpha`.
"""
PARTS = """A table `[material.PLACE]` holds the parameters that differ in a part of the organ. The place is the name of
a cell set, or a condition on the centroids of cells, such as `[material."x > 80%"]`. The table may change any number
that `[material]` gives for the whole organ. To give the part another law, write `law` and all its parameters there.
Where two places overlap, the later table counts; a table with a `law` counts over those without.
"""


def page() -> str:
    """The text of the whole page."""
    return "\n".join((HEAD, *_table(schema.CASE), *_material(), *_tables(), *_scene()))


def _scene() -> Iterator[str]:
    yield "## A scene\n"
    yield f"{fill(scene_schema.SCENE.means, 120)}\n"
    yield from _rows(scene_schema.SCENE.keys)
    tables = (scene_schema.ORGAN, scene_schema.BOND, scene_schema.SPRING, scene_schema.CONTACT, scene_schema.BODY)
    for table in (*tables, scene_schema.SCENE_LOADS):
        yield from _table(table, level="###")


def _tables() -> Iterator[str]:
    for table in (schema.SUPPORT, schema.LOADS, schema.SCAN, schema.SETTINGS):
        yield from _table(table)
    newton = schema.SETTINGS.keys["newton"].value
    assert isinstance(newton, entries.Table)
    for table in (newton, schema.REDUCE, schema.VARY):
        yield from _table(table)


def _table(table: entries.Table, level: str = "##") -> Iterator[str]:
    yield f"{level} {f'`[{table.name}]`' if table.name else 'The organ'}\n"
    yield f"{fill(table.means, 120)}\n"
    yield from _rows(table.keys)


def _material() -> Iterator[str]:
    yield "## `[material]`\n"
    yield "The [law](laws.md) of the tissue, and its parameters.\n"
    yield from _rows({"law": entries.Key(Choice(law.LAWS), "its name", is_required=True)})
    yield "| law | parameters |\n| --- | --- |"
    for kind in law.LAWS:
        yield f"| `{kind}` | {', '.join(f'`{name}`' for name in material_schema.taken_by(kind))} |"
    yield PAIRS
    yield from _rows(material_schema.PARAMETERS)
    for kind, keys in material_schema.OTHERS.items():
        yield f"In `{kind}`, two of these parameters have another meaning:\n"
        yield from _rows(keys)
    yield PARTS
    yield from _table(material_schema.HELICAL)


def _rows(keys: Mapping[str, entries.Key]) -> Iterator[str]:
    yield "| key | meaning | value | default |\n| --- | --- | --- | --- |"
    for name, key in keys.items():
        default = "required" if key.is_required else key.default or "-"
        yield f"| `{name}` | {key.means} | {key.value} | {default} |"
    yield ""


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
