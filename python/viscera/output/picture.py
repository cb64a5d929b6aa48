"""A picture of a deformed organ: shaded and coloured by displacement, over the wireframe of its rest shape.

Projection, hidden surface and shading are done here in a few lines of NumPy: the front-facing triangles, drawn from
back to front, look better in matplotlib and draw faster than its own three-dimensional axes.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Mapping
from typing import Any

from viscera.output import agg  # noqa: F401 - before matplotlib

# isort: split
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import Colormap, LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from viscera.files.atomic import replacing
from viscera.mesh import Floats, Indices
from viscera.output.kind import check_picture

INK, PAPER, ACCENT = "#22262e", "#ffffff", "#0b4f6c"
PARTS = ("#0b4f6c", "#6a8d3a", "#7a4b94", "#c98b1b")
TISSUE = LinearSegmentedColormap.from_list("tissue", ["#f3e3d7", "#eab08f", "#d9654f", "#a31f3a", "#4f0f2b"])
SIGNED = LinearSegmentedColormap.from_list("signed", ["#123f5a", "#4f93b0", "#f3eee8", "#dd7a5c", "#8a1c33"])
COLOURS = {
    "displacement": ("displacement [mm]", 1e3),
    "von_mises": ("von Mises stress [kPa]", 1e-3),
    "pressure": ("pressure [kPa]", 1e-3),
    "band": ("radius of the 95 % band [mm]", 1e3),
    "energy_density": ("strain energy density [kJ/m³]", 1e-3),
}
"""What may colour an organ: its words with the unit, and that unit per SI unit."""
LIGHT = np.array([-0.35, 0.55, 0.76])  # in view axes: right, up, towards the eye
PIECES = 30_000  # small triangles of one picture: enough for smooth shading, a second or two to draw


def draw(
    points: Floats,
    surface: Indices,
    displacement: Floats,
    *,
    values: Floats | None = None,
    colour: str = "displacement",
    force: tuple[Floats, Floats] | None = None,
    view: tuple[float, float] = (20.0, -60.0),
    title: str = "",
    path: str | os.PathLike[str] | None = None,
) -> Figure:
    """Draw the deformed organ, and save it as a PNG where a path is given.

    points (n, 3) at rest [m]; surface (t, 3) triangles, outward; displacement (n, 3) [m]; values (n,) that colour it,
    lengths of displacements without, and what they are, one of `COLOURS`; force: where it acts (3,) [m] and the force
    (3,) [N]; view: elevation and azimuth of the eye [degrees].
    """
    check_picture(path)
    axes = view_axes(*view)
    rest, shape = 1e3 * points @ axes.T, 1e3 * (points + displacement) @ axes.T
    label, factor = COLOURS[colour]
    shown = factor * (np.linalg.norm(displacement, axis=1) if values is None else values)
    figure = Figure(figsize=(9.0, 6.5), dpi=150, facecolor=PAPER, layout="constrained")
    FigureCanvasAgg(figure)
    plot = figure.add_subplot()
    scale = Normalize(min(0.0, shown.min()), max(shown.max(), 1e-9))
    _organ(plot, rest, shape, surface, shown, scale)
    if force is not None:
        _arrow(plot, 1e3 * force[0] @ axes.T, force[1], axes, reach=0.22 * float(np.ptp(rest[:, :2], axis=0).max()))
    _scale_bar(plot, np.concatenate([rest, shape]))
    _colour_bar(figure, scale, plot, label)
    plot.set_title(title, color=INK, loc="left", fontsize=11)
    return _saved(figure, path)


def draw_side_by_side(
    points: Floats,
    surface: Indices,
    displacements: Mapping[str, Floats],
    *,
    view: tuple[float, float] = (20.0, -60.0),
    path: str | os.PathLike[str] | None = None,
) -> Figure:
    """Several deformations of one organ by title, in one scale of colours and lengths; otherwise as `draw`."""
    check_picture(path)
    axes = view_axes(*view)
    rest = 1e3 * points @ axes.T
    shapes = {title: 1e3 * (points + displacement) @ axes.T for title, displacement in displacements.items()}
    lengths = {title: 1e3 * np.linalg.norm(displacement, axis=1) for title, displacement in displacements.items()}
    wide, high = np.ptp(np.concatenate([rest, *shapes.values()])[:, :2], axis=0)
    columns = len(shapes) if high > wide else int(np.ceil(np.sqrt(len(shapes))))
    rows = -(-len(shapes) // columns)
    panel = 10.0 / columns
    size = (10.0, min(rows * max(panel * high / wide, 1.5), 10.0))
    figure = Figure(figsize=size, dpi=150, facecolor=PAPER, layout="constrained")
    FigureCanvasAgg(figure)
    plots = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    scale = Normalize(0.0, max(1e-9, *(length.max() for length in lengths.values())))
    for plot, (title, shape) in zip(plots, shapes.items(), strict=False):
        _organ(plot, rest, shape, surface, lengths[title], scale)
        plot.set_title(title, color=INK, loc="left", fontsize=9)
    for plot in plots[len(shapes) :]:
        plot.set_axis_off()
    _scale_bar(plots[0], np.concatenate([rest, *shapes.values()]))
    _colour_bar(figure, scale, list(plots))
    return _saved(figure, path)


def _organ(plot: Axes, rest: Floats, shape: Floats, surface: Indices, values: Floats, scale: Normalize) -> None:
    """A shape in view axes, coloured by values, over the wireframe of its rest."""
    plot.add_collection(_wireframe(rest, surface, width=0.5, alpha=0.55))
    plot.add_collection(_shaded(shape, surface, values, scale))
    plot.add_collection(_wireframe(rest, surface, width=0.25, alpha=0.10))
    plot.set_aspect("equal")
    plot.set_axis_off()
    plot.autoscale_view()


def _colour_bar(
    figure: Figure, scale: Normalize, plots: Axes | list[Axes], label: str = COLOURS["displacement"][0]
) -> None:
    bar = figure.colorbar(ScalarMappable(scale, TISSUE), ax=plots, shrink=0.6, pad=0.02, aspect=28)
    bar.set_label(label, color=INK)
    bar.outline.set_visible(False)


def _saved(figure: Figure, path: str | os.PathLike[str] | None) -> Figure:
    if path is not None:
        with replacing(path) as scratch:
            figure.savefig(scratch, format="png", facecolor=PAPER)
    return figure


def draw_rest(
    points: Floats,
    surface: Indices,
    *,
    fixed: Indices,
    parts: Mapping[str, Indices],
    view: tuple[float, float] = (20.0, -60.0),
    title: str = "",
    path: str | os.PathLike[str] | None = None,
) -> Figure:
    """Draw the organ at rest with its fixed nodes, and save it as a PNG where a path is given.

    points (n, 3) [m]; surface (t, 3), outward; fixed: node indices; parts: the surfaces of named parts within.
    """
    check_picture(path)
    axes = view_axes(*view)
    rest = 1e3 * points @ axes.T
    figure = Figure(figsize=(9.0, 6.5), dpi=150, facecolor=PAPER, layout="constrained")
    FigureCanvasAgg(figure)
    plot = figure.add_subplot()
    plot.add_collection(_shaded(rest, surface, np.full(len(points), 0.15), Normalize(0.0, 1.0)))
    plot.add_collection(_wireframe(rest, surface, width=0.25, alpha=0.25))
    seen = _visible(rest, surface, fixed)
    hidden, shown = rest[fixed[~seen]], rest[fixed[seen]]
    plot.scatter(hidden[:, 0], hidden[:, 1], s=7, color=INK, alpha=0.2, linewidths=0.0, zorder=4)
    if len(fixed):
        plot.scatter(shown[:, 0], shown[:, 1], s=9, color=INK, zorder=4, label=f"fixed ({len(fixed)} nodes)")
    for (name, inner), colour in zip(parts.items(), itertools.cycle(PARTS)):
        lines = _wireframe(rest, inner, width=0.8, alpha=0.2)
        lines.set(color=colour, alpha=0.8, zorder=5, label=name)
        plot.add_collection(lines)
    _scale_bar(plot, rest)
    if len(fixed) or parts:
        plot.legend(loc="upper right", frameon=False, fontsize=9)
    plot.set_title(title, color=INK, loc="left", fontsize=11)
    plot.set_aspect("equal")
    plot.set_axis_off()
    plot.autoscale_view()
    return _saved(figure, path)


def view_axes(elevation: float, azimuth: float) -> Floats:
    """Rows: the directions to the right, up and towards the eye; z is up in space."""
    e, a = np.radians([elevation, azimuth])
    towards = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    return np.array([right, np.cross(towards, right), towards])


def _shaded(
    shape: Floats,
    surface: Indices,
    values: Floats,
    scale: Normalize,
    colours: Colormap = TISSUE,
    pieces: int = PIECES,
) -> PolyCollection:
    """The visible side of a surface, in small triangles whose colour and light vary as the corners' do."""
    normals = np.cross(shape[surface[:, 1]] - shape[surface[:, 0]], shape[surface[:, 2]] - shape[surface[:, 0]])
    smooth = np.zeros_like(shape)
    for corner in range(3):
        np.add.at(smooth, surface[:, corner], normals)
    smooth /= np.maximum(np.linalg.norm(smooth, axis=1, keepdims=True), 1e-30)
    front = surface[normals[:, 2] > 0.0]
    split = int(np.clip(np.sqrt(pieces / max(len(front), 1)), 1, 6))
    weights = _subdivision(split)
    polygons = np.einsum("pkc,tcx->tpkx", weights, shape[front]).reshape(-1, 3, 3)
    middle = weights.mean(axis=1)
    tint = colours(scale((middle @ values[front].T).T.ravel()))[:, :3]
    facing = np.einsum("pc,tcx->tpx", middle, smooth[front]).reshape(-1, 3)
    facing /= np.maximum(np.linalg.norm(facing, axis=1, keepdims=True), 1e-30)
    light = LIGHT / np.linalg.norm(LIGHT)
    diffuse = np.clip(facing @ light, 0.0, 1.0)[:, None]
    half = light + np.array([0.0, 0.0, 1.0])
    shine = np.clip(facing @ half / np.linalg.norm(half), 0.0, 1.0)[:, None] ** 40
    lit = np.clip(tint * (0.45 + 0.6 * diffuse) + 0.18 * shine, 0.0, 1.0)
    order = np.argsort(polygons[:, :, 2].mean(axis=1))
    return PolyCollection(
        list(polygons[order, :, :2]), facecolors=lit[order], edgecolors=lit[order], linewidths=0.25, zorder=2
    )


def _visible(shape: Floats, surface: Indices, nodes: Indices) -> NDArray[np.bool_]:
    """Which nodes (k,) no triangle hides from the eye."""
    corners = shape[surface]
    a, b, c = corners[:, :, :2].transpose(1, 0, 2)
    double = _cross(b - a, c - a)
    seen = np.ones(len(nodes), dtype=bool)
    for k, node in enumerate(nodes):
        p = shape[node, :2]
        weights = np.stack([_cross(b - p, c - p), _cross(c - p, a - p), _cross(a - p, b - p)], axis=-1)
        with np.errstate(divide="ignore", invalid="ignore"):
            weights /= double[:, None]
        covers = (weights > 1e-9).all(axis=1) & ~(surface == node).any(axis=1)
        seen[k] = not (np.einsum("tc,tc->t", weights[covers], corners[covers, :, 2]) > shape[node, 2]).any()
    return seen


def _cross(u: Floats, v: Floats) -> Floats:
    return np.asarray(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])


def _subdivision(split: int) -> Floats:
    """Barycentric weights (split^2, 3, 3) of the small triangles of a triangle whose edges are cut in `split`."""
    pieces = []
    for i in range(split):
        for j in range(split - i):
            pieces.append([(i, j), (i + 1, j), (i, j + 1)])
            if i + j < split - 1:
                pieces.append([(i + 1, j), (i + 1, j + 1), (i, j + 1)])
    corners = np.array(pieces, dtype=float) / split
    return np.concatenate([1.0 - corners.sum(axis=2, keepdims=True), corners], axis=2)


def _wireframe(shape: Floats, surface: Indices, width: float, alpha: float) -> LineCollection:
    """The edges of the visible side of a surface; the faint one lies over the body, the strong one behind it."""
    a, b, c = shape[surface].transpose(1, 0, 2)
    front = surface[np.cross(b - a, c - a)[:, 2] > 0.0]
    edges = np.unique(np.sort(np.concatenate([front[:, [0, 1]], front[:, [1, 2]], front[:, [2, 0]]]), axis=1), axis=0)
    above = 1 if alpha > 0.3 else 3
    return LineCollection(list(shape[edges][:, :, :2]), colors=ACCENT, linewidths=width, alpha=alpha, zorder=above)


def _arrow(plot: Axes, tip: Floats, force: Floats, axes: Floats, reach: float) -> None:
    """The force of the tool on the organ: towards the surface if it pushes, away from it if it pulls."""
    size = float(np.linalg.norm(force))
    if size == 0.0:
        return
    direction = (axes @ force / size)[:2] * reach
    (x0, y0), (x1, y1) = tip[:2] - direction, tip[:2]
    halo = [withStroke(linewidth=3.5, foreground=PAPER)]
    shaft = {"arrowstyle": "-|>,head_width=0.35,head_length=0.7", "color": INK, "linewidth": 2.0, "path_effects": halo}
    plot.annotate("", xy=(x1, y1), xytext=(x0, y0), arrowprops=shaft, zorder=5)
    label: dict[str, Any] = {
        "textcoords": "offset points",
        "color": INK,
        "fontsize": 11,
        "path_effects": halo,
        "zorder": 5,
    }
    plot.annotate(f"{size:.3g} N", xy=(x0, y0), xytext=(6, 6), **label)
    plot.update_datalim(np.array([(x0, y0), (x1, y1)]))


def _scale_bar(plot: Axes, shape: Floats) -> None:
    """A bar of a round length [mm] below the organ, on the left."""
    low, extent = shape[:, :2].min(axis=0), np.ptp(shape[:, :2], axis=0)
    decade = 10.0 ** np.floor(np.log10(extent[0] / 3.0))
    bar = decade * max(step for step in (1.0, 2.0, 5.0) if step * decade <= extent[0] / 3.0)
    y = low[1] - 0.06 * extent[1]
    plot.plot([low[0], low[0] + bar], [y, y], color=INK, linewidth=2.0, solid_capstyle="butt")
    plot.text(low[0] + bar / 2, y - 0.015 * extent[1], f"{bar:g} mm", color=INK, ha="center", va="top", fontsize=9)


def draw_panels(
    points: Floats,
    surface: Indices,
    values: Mapping[str, Floats],
    *,
    label: str,
    displacements: Mapping[str, Floats] | None = None,
    marks: Mapping[str, Floats] | None = None,
    is_signed: bool = False,
    is_common: bool = True,
    columns: int = 2,
    view: tuple[float, float] = (20.0, -60.0),
) -> Figure:
    """Values on the surface of an organ, one panel for each title, with a legend of colours.

    points (n, 3) [m]; values (n,) by title, in the unit that `label` names; displacements (n, 3) [m] by title, over the
    wireframe of the rest shape; marks: points (k, 3) [m] by title, drawn as dots; is_signed: colours for both signs,
    zero in the middle; is_common: one scale for all panels, or one each.
    """
    axes = view_axes(*view)
    rest = 1e3 * points @ axes.T
    shapes = {title: rest + 1e3 * (displacements or {}).get(title, np.zeros_like(points)) @ axes.T for title in values}
    wide, high = np.ptp(np.concatenate(list(shapes.values()))[:, :2], axis=0)
    columns = min(columns, len(values))
    rows = -(-len(values) // columns)
    panel = 11.0 / columns
    height = min(rows * (max(0.9 * panel * high / wide, 1.0) + 0.4), 14.0)
    figure = Figure(figsize=(11.0, height), dpi=150, facecolor=PAPER, layout="constrained")
    FigureCanvasAgg(figure)
    plots = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    colours = SIGNED if is_signed else TISSUE
    common = _scale_of(np.concatenate(list(values.values())), is_signed)
    for plot, (title, field) in zip(plots, values.items(), strict=False):
        scale = common if is_common else _scale_of(field, is_signed)
        if displacements is not None:
            plot.add_collection(_wireframe(rest, surface, width=0.4, alpha=0.4))
        plot.add_collection(_shaded(shapes[title], surface, field, scale, colours, PIECES // len(values)))
        for dot in (marks or {}).get(title, np.empty((0, 3))):
            x, y, _ = 1e3 * axes @ dot
            plot.plot(x, y, "o", color=INK, markersize=5, markeredgecolor=PAPER, zorder=5)
        plot.set_title(title, color=INK, loc="left", fontsize=10)
        plot.set_aspect("equal")
        plot.autoscale_view()
        if not is_common:
            _legend(figure, scale, colours, plot, label)
    for plot in plots:
        plot.set_axis_off()
    _scale_bar(plots[0], np.concatenate(list(shapes.values())))
    if is_common:
        _legend(figure, common, colours, list(plots), label)
    return figure


def _scale_of(values: Floats, is_signed: bool) -> Normalize:
    """From the least to the largest value, or symmetric about zero."""
    largest = max(float(np.abs(values).max()), 1e-30)
    return Normalize(-largest, largest) if is_signed else Normalize(float(values.min()), float(values.max()) + 1e-30)


def _legend(figure: Figure, scale: Normalize, colours: Colormap, plots: Axes | list[Axes], label: str) -> None:
    bar = figure.colorbar(ScalarMappable(scale, colours), ax=plots, shrink=0.7, pad=0.02, aspect=24)
    bar.set_label(label, color=INK)
    bar.outline.set_visible(False)
