"""The page of a model: opened by the model, or by stepping the organ until a large model has arrived.

Two hands at once are answered by stepping the organ, where the page has what that takes.
"""

from __future__ import annotations

from viscera.errors import VisceraError
from viscera.reduced.touch import Touch
from viscera.viewer import page
from viscera.viewer.live import PAGE_UNKNOWNS, first_case


def page_of(
    touch: Touch, model: bytes, name: str, *, is_hybrid: bool | None = None, is_near: bool = False
) -> dict[str, bytes]:
    """The files of the page of a model, given as the bytes that it loads.

    is_hybrid: whether the page steps the organ until the model has arrived. By default it does where a page can step
        the organ, and the stepper is built and smaller than the model. Raises `VisceraError` if True and impossible.
    is_near: whether the page comes from this machine, so that what steps the organ may be larger than the model.
    """
    plain = {**page.files(), page.MODEL: model}
    is_larger = len(model) > page.stepping_bytes()
    may_step = is_hybrid or (page.can_step() and (is_near or (is_hybrid is None and is_larger)))
    first = first_case(touch, name) if may_step else None
    if first is not None and is_hybrid is None:
        is_hybrid = len(model) > page.stepping_bytes() + len(first.data)
    if first is not None and is_hybrid:
        return page.hybrid_files(model, first.data)
    if is_hybrid:
        raise VisceraError(
            "a page cannot step the organ of this model: it is touched under a preload, has no cells, or has more than "
            f"{PAGE_UNKNOWNS} degrees of freedom"
        )
    return page.two_handed_files(model, first.data) if first is not None and is_near else plain
