"""The errors of the driver. Every message is one line that says what is wrong and where."""

__all__ = ["ConfigError", "RunError", "StoreError"]


class ConfigError(ValueError):
    """A configuration does not describe a run."""


class RunError(Exception):
    """A run cannot be started, continued or shown."""


class StoreError(RunError):
    """The record of a run cannot be used."""
