"""The page of a model: opened by the model, or by stepping the organ until a large model has arrived."""

from __future__ import annotations

from viscera.errors import VisceraError
from viscera.touch import Touch
from viscera.viewer import page
from viscera.viewer.live import PAGE_UNKNOWNS, first_case


def page_of(touch: Touch, model: bytes, name: str, *, is_hybrid: bool | None = None) -> dict[str, bytes]:
    """The files of the page of a model, given as the bytes that it loads.

    is_hybrid: whether the page steps the organ until the model has arrived. By default it does where a page can step
    the organ, and the stepper is built and smaller than the model. Raises `VisceraError` if True and impossible.
    """
    plain = {**page.files(), page.MODEL: model}
    if is_hybrid is False or (is_hybrid is None and len(model) <= page.stepping_bytes()):
        return plain
    first = first_case(touch, name)
    if first is not None and (is_hybrid or len(model) > page.stepping_bytes() + len(first.data)):
        return page.hybrid_files(model, first.data)
    if is_hybrid:
        raise VisceraError(
            "a page cannot step the organ of this model: it is touched under a preload, has no cells, or has more than "
            f"{PAGE_UNKNOWNS} degrees of freedom"
        )
    return plain
