"""What organs and laws are made of is compiled or copied: to change it afterwards is refused, not ignored."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import viscera as vs
from viscera.contact.shapes import AnyShape

LAW = vs.NeoHookean(young=1e5, poisson=0.3)
LAWS: list[vs.laws.Law] = [
    LAW,
    vs.Yeoh(c10=500.0, poisson=0.45),
    vs.MooneyRivlin(c1=1e3, c2=1e2, kappa=1e5),
    vs.HolzapfelGasserOgden(3e3, 2.4e3, 0.84, fibres=[(1, 0, 1), (1, 0, -1)], kappa=1e5),
    vs.StrainEnergy("mu/2*(I1 - 3) - mu*log(J) + lam/2*log(J)**2", mu=1e3, lam=4e3),
]
SHAPES: list[AnyShape] = [vs.Sphere(0.1), vs.Capsule(0.1, 0.2), vs.Box(0.1), vs.Shape(vs.organs.beam())]
JOINTS: list[Any] = [
    vs.ElasticSupport(np.arange(3), stiffness=1e6),
    vs.Spring("tip", point=(1.0, 0.1, 0.6), stiffness=100.0),
    vs.Bond("a", "b"),
    vs.ContactPair("a", "b"),
]
AGAIN: list[Callable[[Any], Any]] = [
    lambda thing: thing,
    copy.copy,
    copy.deepcopy,
    lambda t: pickle.loads(pickle.dumps(t)),
]
again = pytest.mark.parametrize("again", AGAIN, ids=["made", "copied", "copied in depth", "pickled"])


def public(thing: Any) -> dict[str, Any]:
    return {name: value for name, value in vars(thing).items() if not name.startswith("_")}


@again
@pytest.mark.parametrize("thing", [*LAWS, *SHAPES, *JOINTS], ids=lambda thing: type(thing).__name__)
def test_no_public_attribute_is_assigned_again(thing: Any, again: Callable[[Any], Any]) -> None:
    there = again(thing)
    assert public(there)
    for name, value in public(there).items():
        with pytest.raises(vs.VisceraError, match=rf"^the {name} of an? \w+ cannot be changed.*; make another$"):
            setattr(there, name, value)
        for array in value if isinstance(value, tuple) else (value,):
            if isinstance(array, np.ndarray):
                with pytest.raises(ValueError, match="read-only"):
                    array[:] = 0.0


@again
def test_an_organ_says_what_gives_another(bar: vs.Mesh, again: Callable[[Any], Any]) -> None:
    organ: Any = again(vs.Organ(bar, LAW, "root"))
    for name, remedy in {"law": "with_law", "mesh": "with_mesh", "element": "make another", "fixed": "make"}.items():
        with pytest.raises(vs.VisceraError, match=f"the {name} of an Organ cannot be changed: .*{remedy}"):
            setattr(organ, name, getattr(organ, name))
    with pytest.raises(vs.VisceraError, match="the supports of an Organ"):
        organ.supports = ()
    with pytest.raises(ValueError, match="read-only"):
        organ.fixed[0] = 1
    with pytest.raises(ValueError, match="read-only"):
        organ.law.parameters[:] *= 0.1
    with pytest.raises(ValueError, match="read-only"):
        organ.law.mu[:] = 1.0
    with pytest.raises(vs.VisceraError, match="the young of a NeoHookean"):
        organ.law.young = 1.0


@again
def test_a_scene_keeps_its_organs(bar: vs.Mesh, again: Callable[[Any], Any]) -> None:
    scene: Any = again(vs.Scene({"bar": vs.Organ(bar, LAW, "root")}))
    with pytest.raises(TypeError, match="item assignment"):
        scene.organs["bar"] = vs.Organ(bar, LAW, "root")
    for name in ("organs", "bodies", "bonds", "contacts", "law"):
        with pytest.raises(vs.VisceraError, match=f"the {name} of a Scene cannot be changed"):
            setattr(scene, name, getattr(scene, name))


def test_an_array_that_is_given_may_change_afterwards(bar: vs.Mesh) -> None:
    nodes, young = bar.nodes("root").copy(), np.full(len(bar.cells), 1e5)
    bed, law = vs.ElasticSupport(nodes, stiffness=1e6), vs.NeoHookean(young=young, poisson=0.3)
    nodes[:], young[:] = 0, 1.0
    assert isinstance(bed.where, np.ndarray)
    assert np.array_equal(bed.where, bar.nodes("root"))
    assert np.allclose(law.young, 1e5)


def test_a_probe_is_moved_and_not_assigned(bar: vs.Mesh) -> None:
    touch = vs.Organ(bar, LAW, "root").reduce("x > 99%", depth="1%", order=2)
    probe: Any = touch.probe(friction=0.3)
    felt = probe.place(touch.mesh.points[0] + 1.0)
    assert np.array_equal(probe.position, felt.center)
    for name, remedy in {
        "radius": "make another",
        "friction": "make another",
        "position": "`place` and `move`",
    }.items():
        with pytest.raises(vs.VisceraError, match=f"the {name} of a RigidProbe cannot be changed: .*{remedy}"):
            setattr(probe, name, 0.1)
