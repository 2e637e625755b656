"""Graph grammars of bodies: rules as data, that rewrite a tree of parts until it is a robot.

In the manner of RoboGrammar (Zhao et al. 2020). A rule has a left graph, which is looked for in the
tree, and a right graph, which takes its place. Labels that some rule has on its left alone are
unfinished; labels of `Grammar.cells` build cells.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, model_validator

from warp_springs import config as configs

__all__ = ["ANY", "NO_JOINT", "Edge", "Grammar", "Graph", "Part", "Rule", "load_grammar"]

ANY = "*"
"""A label of a left graph that fits every node; on the right the node keeps the label it has."""
NO_JOINT = "none"
"""In a rule: the child is fixed to its parent."""

Share = tuple[float, float]
"""Lowest and highest of what a gene chooses."""


class Part(configs.Section):
    """A kind of cell: a segment of a body or of a limb, or a joint between two."""

    length: Share = (1.0, 1.0)
    """Lowest and highest length [edges]."""
    pitch: Share = (0.0, 0.0)
    """How far its tip is turned up [rad]."""
    yaw: Share = (0.0, 0.0)
    """How far its tip is turned to the left; of a mirrored twin, to the right [rad]."""
    taper: float = Field(1.0, gt=0.2, le=2.0)
    """Width of its tip in widths of its base."""
    stiffness: Share = (0.5, 0.5)
    """Lowest and highest, 0 to 1 of the logarithm between the bounds of the encoding."""
    moves: Literal["not", "swell", "bend", "swing"] = "not"
    """Whether it is a muscle, and what that does: grow longer, bend up and down, or sideways."""
    swing: Share = (0.0, 1.0)
    """How far it moves, 0 to 1 of the largest amplitude."""

    @model_validator(mode="after")
    def _is_a_cell(self) -> Part:
        bounds = {"length": (0.2, 3.0), "pitch": (-1.2, 1.2), "yaw": (-1.2, 1.2)}
        bounds |= {"stiffness": (0.0, 1.0), "swing": (0.0, 1.0)}
        for name, (least, most) in bounds.items():
            low, high = getattr(self, name)
            if not least <= low <= high <= most:
                raise ValueError(
                    f"{name} = [{low:g}, {high:g}] given, expected two numbers from {least:g} to "
                    f"{most:g}, the lower first"
                )
        return self


class Edge(configs.Section):
    """A child that grows on a side of its parent. On a left side, what is left out is any."""

    parent: str
    child: str
    side: Literal["tip", "up", "down", "left", "right"] | None = None
    """Of the parent; a new edge is at its tip unless told otherwise."""
    joint: str | None = None
    """A name of `Grammar.joints`, or "none"; a new edge has none unless told otherwise."""
    mirror: bool | None = None
    """Whether the child, and all that hangs on it, grows on the opposite side too, mirrored."""

    @model_validator(mode="after")
    def _has_an_opposite(self) -> Edge:
        if self.mirror and self.side not in ("left", "right"):
            raise ValueError(f"mirror: only left and right have an opposite side, not {self.side}")
        return self


class Graph(configs.Section):
    """Some nodes, by names that mean the same on both sides of a rule, and how they hang on."""

    nodes: dict[str, str] = Field(min_length=1)
    """Name -> label."""
    edges: tuple[Edge, ...] = ()

    @model_validator(mode="after")
    def _is_a_tree(self) -> Graph:
        for edge in self.edges:
            for name in (edge.parent, edge.child):
                if name not in self.nodes:
                    raise ValueError(f"an edge names {name!r}, nodes are {_listed(self.nodes)}")
        children = [edge.child for edge in self.edges]
        twice = [name for name in children if children.count(name) > 1]
        if twice:
            raise ValueError(f"{twice[0]!r} has two parents: bodies are trees")
        if len(self.order) < len(self.nodes):
            lost = [name for name in self.nodes if name not in self.order]
            raise ValueError(f"{lost[0]!r} does not hang together with {self.top!r}")
        return self

    @property
    def top(self) -> str:
        """The node that has no parent here."""
        children = {edge.child for edge in self.edges}
        return next((name for name in self.nodes if name not in children), next(iter(self.nodes)))

    @property
    def order(self) -> list[str]:
        """The nodes that hang together with the top, parents before children."""
        found = [self.top]
        for name in found:
            found += [e.child for e in self.edges if e.parent == name and e.child not in found]
        return found

    @property
    def inward(self) -> dict[str, Edge]:
        """Child -> the edge that it hangs on."""
        return {edge.child: edge for edge in self.edges}


class Rule(configs.Section):
    """What a left graph becomes."""

    name: str
    left: Graph
    right: Graph
    weight: float = Field(1.0, gt=0.0)
    """How likely chance takes it, compared with others that apply."""

    @model_validator(mode="after")
    def _fits(self) -> Rule:
        left, right = self.left, self.right
        if left.top != right.top:
            raise ValueError(
                f"rule {self.name!r}: the node without a parent is {left.top!r} on the left and "
                f"{right.top!r} on the right; it must stay the same"
            )
        for name, label in right.nodes.items():
            if label == ANY and left.nodes.get(name) != ANY:
                raise ValueError(f"rule {self.name!r}: {name!r} = {ANY!r} on the right alone")
        return self

    @property
    def adds(self) -> int:
        """Nodes that it adds."""
        return len(self.right.nodes) - len(self.left.nodes)


class Grammar(configs.Section):
    """Parts of bodies and the rules by which they come together."""

    about: str = ""
    start: str
    """Label of the one node that there is at first."""
    cells: dict[str, Part] = Field(min_length=1)
    """Labels that build a cell."""
    joints: dict[str, Part] = Field(default_factory=dict)
    """Cells between a parent and its child, by the name of the joint."""
    rules: tuple[Rule, ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _is_sound(self) -> Grammar:
        if NO_JOINT in self.joints or ANY in self.cells:
            raise ValueError(f"{NO_JOINT!r} is no name of a joint and {ANY!r} none of a cell")
        rewritten = {label for rule in self.rules for label in rule.left.nodes.values()}
        known = self.cells.keys() | rewritten
        if self.start not in known:
            raise ValueError(f"start: no rule rewrites {self.start!r}, and it is no cell")
        for rule in self.rules:
            where = f"rule {rule.name!r}"
            for label in rule.right.nodes.values():
                if label not in known:
                    raise ValueError(f"{where}: no rule rewrites {label!r}, and it is no cell")
            for edge in (*rule.left.edges, *rule.right.edges):
                if edge.joint not in (None, NO_JOINT, *self.joints):
                    raise ValueError(
                        f"{where}: there is no joint {edge.joint!r}, joints are "
                        f"{_listed(self.joints)}"
                    )
        return self


def load_grammar(source: str, folder: Path | None = None) -> Grammar:
    """Read a packaged grammar by its name, or a file of rules, TOML or JSON.

    Args:
        source: The name, or the path of a file that ends in .toml or .json.
        folder: Where a relative path begins; where we are if left out.

    Raises:
        ConfigError: There is no such thing, or it is no grammar; one line that says what is wrong.
    """
    if Path(source).suffix in (".toml", ".json"):
        path = Path(source) if folder is None else folder / source
        return _parsed(configs.read_text(path), str(source), path.suffix == ".json")
    shipped = resources.files("evolve") / "grammars"
    names = sorted(p.name[:-5] for p in shipped.iterdir() if p.name.endswith(".toml"))
    if source not in names:
        raise configs.ConfigError(
            f"there is no grammar {source!r}; grammars are {_listed(names)}, and files end in "
            ".toml or .json"
        )
    return _parsed((shipped / f"{source}.toml").read_text("utf-8"), f"grammar {source}", False)


def _parsed(text: str, source: str, is_json: bool) -> Grammar:
    if not is_json:
        return configs.parse(Grammar, text, source)
    try:
        data: Any = json.loads(text)
    except json.JSONDecodeError as error:
        raise configs.ConfigError(f"{source} is not valid JSON: {error}") from None
    if not isinstance(data, Mapping):
        raise configs.ConfigError(f"{source}: expected an object with start, cells and rules")
    return configs.validate(Grammar, data, source)


def _listed(names: Any) -> str:
    return ", ".join(names) or "none"
