"""The soak of benchmarks/soak.py for half a second of each kind, with a seed of its own."""

from __future__ import annotations

import importlib
import re
from pathlib import Path
from types import ModuleType

import pytest

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"
KINDS = (
    "quasi-static, cholesky", "quasi-static, cg", "backward Euler, cholesky", "Newmark, cg", "backward Euler, SVK",
)  # fmt: skip


@pytest.fixture
def soak(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(BENCHMARKS)
    return importlib.import_module("soak")


def test_every_kind_is_soaked(soak: ModuleType) -> None:
    assert tuple(soak.KINDS) == KINDS


@pytest.mark.parametrize("kind", KINDS)
def test_a_random_hand_does_no_harm(soak: ModuleType, kind: str, capsys: pytest.CaptureFixture[str]) -> None:
    """No frame fails or turns a cell inside out, all is finite, and let go the organ comes back to rest."""
    faults = soak.soak(kind, 0.5, 4077)
    frames = int(re.match(rf"{re.escape(kind)}\s+(\d+)", capsys.readouterr().out)[1])  # type: ignore[index]
    assert faults == []
    assert frames > 0


def test_a_fault_is_a_verdict(soak: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    """Were a cell turned inside out, it would be told."""
    monkeypatch.setattr(soak, "volumes", lambda mesh, displacement: -(displacement[:1, 0] ** 2))
    assert soak.soak(KINDS[0], 0.5, 4077) == ["frame 1 has a cell inside out"]
