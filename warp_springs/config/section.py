"""What all tables of a configuration have in common."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, Union

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationInfo

__all__ = ["BesideFile", "Section", "Triple", "one_of"]

Triple = tuple[float, float, float]


def _beside(path: Path, info: ValidationInfo) -> Path:
    folder = (info.context or {}).get("folder")
    return path if folder is None else (folder / path).resolve()


BesideFile = Annotated[Path, AfterValidator(_beside)]
"""The path of a file, relative to the folder of the configuration that names it."""


class Section(BaseModel):
    """A table of a configuration: unchangeable, and unknown keys are refused."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", allow_inf_nan=False, use_attribute_docstrings=True
    )


def one_of(models: Iterable[type[Section]], key: str) -> Any:
    """A section whose key says which of several models it is."""
    models = tuple(models)
    if len(models) == 1:
        return models[0]
    return Annotated[Union[models], Field(discriminator=key)]  # noqa: UP007 (built at run time)
