"""Evolution of soft robots: encodings, optimizers, and runs that can be killed and resumed.

    from evolve import Search, load

    search = Search(load("cube", {"seed": 3}))
    while not search.finished:
        print(search.step().scores.fitness.max())

Uses nothing but the public face of `warp_springs`.
"""

from importlib import import_module

__all__ = [
    "ENCODINGS",
    "FITNESS",
    "OPTIMIZERS",
    "Evaluator",
    "Run",
    "RunConfig",
    "Scores",
    "Search",
    "Store",
    "Streams",
    "load",
    "preset_names",
]

# The command line answers --help at once because nothing is loaded before it is used.
_MODULES = {
    "ENCODINGS": "encodings",
    "FITNESS": "fitness",
    "OPTIMIZERS": "optimizers",
    "Evaluator": "judging.evaluate",
    "Run": "run",
    "RunConfig": "config",
    "Scores": "judging.scores",
    "Search": "search",
    "Store": "store",
    "Streams": "streams",
    "load": "toml",
    "preset_names": "toml",
}


def __getattr__(name: str):
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
