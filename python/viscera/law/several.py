"""Several laws in one organ, each in its own part."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from viscera import _core
from viscera.errors import VisceraError
from viscera.law.base import Law
from viscera.mesh import Floats
from viscera.quantity import refused

if TYPE_CHECKING:
    from viscera.mesh import Mesh


class Several(Law):
    """Several laws in one organ, such as a vessel in a liver.

    laws: the law of each part by its place, a cell set's name, a condition on centroids, indices or a predicate, as in
    `Mesh.cells_in`; where two places overlap, the later one counts. A law may have one value of each parameter or one
    per cell of the mesh. `Organ(mesh, {"liver": ..., "vein": ...})` makes this law by itself.

    If one of the laws forbids inverted cells, all do. Raises `VisceraError` for a cell without a law, and for `Linear`
    beside another law, because its stress holds for small strains only.

    >>> import viscera as vs
    >>> beam = vs.organs.beam()
    >>> stiff, soft = vs.Yeoh(c10=5e3, poisson=0.45), vs.NeoHookean(young=3e3, poisson=0.45)
    >>> vs.laws.Several(beam, {"x < 50%": stiff, "x >= 50%": soft})
    Several(Yeoh(c10=5000, c20=0, c30=0, kappa=96666.7) in 960 cells, NeoHookean(mu=1034.48, lam=9310.34) in 960 cells)
    """

    prefix: ClassVar[str] = "laws "
    between: ClassVar[str] = "; "

    def __init__(self, mesh: Mesh, laws: Mapping[Any, Law]) -> None:
        if not isinstance(laws, Mapping) or not laws:
            raise refused("the laws", "a table of laws by place, such as {'liver': NeoHookean(...)}", laws)
        of_cell = np.full(len(mesh.cells), -1)
        for k, (place, law) in enumerate(laws.items()):
            if not isinstance(law, Law) or isinstance(law, Several):
                raise VisceraError(f"the law of {place!r} must be one of viscera.laws, such as NeoHookean, got {law!r}")
            if len(law.parameters) not in {1, len(mesh.cells)}:
                raise VisceraError(
                    f"the law of {place!r} has parameters for {len(law.parameters)} cells, the mesh has "
                    f"{len(mesh.cells)} cells"
                )
            of_cell[mesh.cells_in(place)] = k
        if (of_cell < 0).any():
            cell = int(np.argmax(of_cell < 0))
            raise VisceraError(
                f"{np.count_nonzero(of_cell < 0)} cells have no law, the first of them cell {cell}; name a law for "
                "every part, such as {'x >= 0%': ...} before the others"
            )
        self._take(tuple(laws.values()), of_cell)

    @classmethod
    def of_cells(cls, laws: tuple[Law, ...], of_cell: ArrayLike) -> Law:
        """Laws by the index of each cell's, (m,).

        >>> import viscera as vs
        >>> pair = (vs.NeoHookean(young=3e3, poisson=0.45), vs.NeoHookean(young=6e3, poisson=0.45))
        >>> vs.laws.Several.of_cells(pair, [0, 1, 1]).young.tolist()
        [3000.0, 6000.0, 6000.0]
        """
        several = cls.__new__(cls)
        several._take(laws, np.asarray(of_cell))
        return several

    def _take(self, laws: tuple[Law, ...], of_cell: Any) -> None:
        if any(law.name == "linear" for law in laws) and len({law.name for law in laws}) > 1:
            raise VisceraError(
                "Linear stands beside no other law, as its stress is one of small strains; use Corotated"
            )
        self.laws = laws
        """The laws."""
        self.of_cell = of_cell
        """Index (m,) of each cell's law."""
        width = 1 + max(law.parameters.shape[1] for law in laws)
        rows = np.zeros((len(of_cell), width))
        rows[:, 0] = of_cell
        for k, law in enumerate(laws):
            cells = np.flatnonzero(of_cell == k)
            own = law.parameters[cells] if len(law.parameters) > 1 else law.parameters
            rows[cells, 1 : 1 + own.shape[1]] = own
        super().__init__(self.prefix + self.between.join(law.name for law in laws), rows)

    @classmethod
    def _of_columns(cls, name: str, columns: Floats) -> Law:
        from viscera.law import from_core

        _core.Law(name, np.ascontiguousarray(columns.T))  # refuses the index of a law that is not there
        names = name.removeprefix(cls.prefix).split(cls.between)
        used, of_cell = np.unique(columns[0].astype(int), return_inverse=True)
        laws = []
        for k, own in enumerate(names[index] for index in used):
            rows = columns[1 : 1 + len(_core.law_parameters(own))].T
            first = rows[np.argmax(of_cell == k)]
            rows = np.where((of_cell == k)[:, None], rows, first)
            laws.append(from_core(own, first if (rows == first).all() else rows))
        return cls.of_cells(tuple(laws), of_cell)

    @property
    def stresses(self) -> tuple[int, ...]:
        """Those of the law that all cells have in common; raises `VisceraError` if they have several."""
        used = np.unique(self.of_cell)
        if len(used) > 1:
            raise VisceraError(
                "the cells have several laws, which no one parameter scales; name a part that has a single law"
            )
        return tuple(1 + k for k in self.laws[used[0]].stresses)

    @property
    def is_analytic(self) -> bool:
        """Whether every one of the laws is."""
        return all(law.is_analytic for law in self.laws)

    def __repr__(self) -> str:
        counts = np.bincount(self.of_cell, minlength=len(self.laws))
        each = [f"{law!r} in {count} cells" for law, count in zip(self.laws, counts, strict=True)]
        return f"Several({', '.join(each)})"
