"""The light that the organ mirrors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from numpy.typing import NDArray

if TYPE_CHECKING:
    from tests.web.conftest import Viewer

# Half-precision texels of all faces, level by level; the last one only ends the list.
STUDIO = """() => {
    const { image, mipmaps } = viscera.stage.scene.environment;
    const levels = [image, ...mipmaps.slice(0, -1).map((level) => level.image)];
    return levels.map((faces) => faces.flatMap((face) => [...face.image.data]));
}"""
SIZES = (64, 32, 16, 8)


def test_the_organ_mirrors_the_studio_at_every_roughness(viewer: Viewer) -> None:
    """Each level is the studio under the lobe of GGX seen along the normal, by the sum over all texels of the sharpest:
    `sum L D (n.l) / sum D (n.l)`, `D = a^2 / ((n.h)^2 (a^2 - 1) + 1)^2`, a the roughness squared.
    """
    levels = [np.array(level, np.uint16).view(np.float16).astype(float) for level in viewer.page.evaluate(STUDIO)]
    light, *others = (level.reshape(-1, 4)[:, :3] for level in levels)
    assert [len(level) for level in (light, *others)] == [6 * size * size for size in SIZES]
    directions, solid_angles = texels(SIZES[0])
    for k, (level, size) in enumerate(zip(others, SIZES[1:], strict=True), 1):
        squared = (1 - np.sqrt(1 - k / len(others))) ** 4
        normals, _ = texels(size)
        for n in range(0, len(level), 7 * size):
            cosine = directions @ normals[n]
            lobe = squared / ((1 + cosine) / 2 * (squared - 1) + 1) ** 2 * np.maximum(cosine, 0) * solid_angles
            assert level[n] == pytest.approx(lobe @ light / lobe.sum(), rel=0.04)


def texels(size: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Directions and solid angles, up to a factor, of the texels of faces +x -x +y -y +z -z; x is mirrored."""
    v, u = np.meshgrid(*[(2 * np.arange(size) + 1) / size - 1] * 2, indexing="ij")
    one = np.ones_like(u)
    faces = [(-one, -v, -u), (one, -v, u), (-u, one, v), (-u, -one, -v), (-u, -v, one), (u, -v, -one)]
    points = np.concatenate([np.stack(face, axis=-1).reshape(-1, 3) for face in faces])
    lengths = np.linalg.norm(points, axis=1)
    return points / lengths[:, None], lengths**-3
