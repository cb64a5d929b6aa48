"""The samples of one support or bond among those of all, which a model keeps together."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

from viscera.boundary.bond import Bond
from viscera.boundary.ties import Tied, Ties
from viscera.errors import VisceraError
from viscera.joined import numbers_of, parted_mesh, pieces_of, renumbered
from viscera.mesh import Mesh

if TYPE_CHECKING:
    from viscera.organ import Organ


def among_those_of_a_model(support: Tied | Bond, organ: Organ) -> list[Ties]:
    """The samples of a support or of a bond on the organ of a model; none if the organ is of no model.

    They are found anew on the mesh, and must be among those that the model keeps. Raises `VisceraError` if they are
    not, or if several organs of a scene have a support like this one.
    """
    kept = [own for own in organ.supports if isinstance(own, Ties)]
    if not kept:
        return []
    anew = _of_bond(support, organ) if isinstance(support, Bond) else _on_each_organ(support, organ.mesh)
    found = [own for own in anew if any(each.holds(own) for each in kept)]
    if not found:
        raise VisceraError(
            f"{support!r} is not found among the supports of this model, which keeps them all together, bonds too: "
            "place, stiffness and shape must be those of the reduced organ or scene. A solve of that under the touch "
            "tells the force of each; "
            "`answer.support_force(touch.organ().supports[0])` tells the force of all supports"
        )
    if len(found) > 1:
        raise VisceraError(
            f"{len(found)} organs of this model of a scene have a support as {support!r}, and the model does not know "
            "them apart; `answer['NAME'].support_force(...)` tells the force on the organ of that name"
        )
    return found


def _of_bond(bond: Bond, organ: Organ) -> list[Ties]:
    """The samples of a bond, if it joins organs of a model of a scene."""
    parts = parted_mesh(organ.mesh)
    with suppress(VisceraError):  # names or places that the parts do not have, or surfaces that are apart
        pieces = pieces_of(bond, organ.mesh, parts, numbers_of(parts))
        return [bond._samples(organ.mesh, pieces, organ.law)]
    return []


def _on_each_organ(support: object, mesh: Mesh) -> list[Ties]:
    """The samples of a support on each organ of a model of a scene, where its place is meant, or on the one organ."""
    if not isinstance(support, Tied):
        return []
    parts = parted_mesh(mesh)
    if not parts:
        return [support.ties(mesh)]
    numbers, found = numbers_of(parts), []
    for name, part in parts.items():
        with suppress(VisceraError):  # an organ without such a place
            found.append(renumbered(support.ties(part), numbers[name]))
    return found
