"""Derivations: a tree of parts, rewritten by the rules of a graph grammar step by step."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property

from evolve.bodies.graph_grammar import ANY, NO_JOINT, Edge, Grammar, Rule

__all__ = ["Node", "Tree", "apply", "choices", "derive", "matches"]

Genes = tuple[float, ...]
Match = dict[str, int]
"""Name of a node in a rule -> node of the tree."""


@dataclass(frozen=True)
class Node:
    """A part, and how it hangs on its parent."""

    label: str
    genes: Genes = ()
    """Of the step that gave it its label."""
    parent: int = -1
    side: str = "tip"
    joint: str = NO_JOINT
    mirror: bool = False


@dataclass(frozen=True)
class Tree:
    """The parts of a body by their numbers, 0 the root. Never changed in place."""

    nodes: dict[int, Node] = field(default_factory=dict)
    newest: int = 0
    """Largest number that was ever used."""

    @cached_property
    def _hanging(self) -> dict[int, list[int]]:
        found: dict[int, list[int]] = {}
        for number, node in self.nodes.items():
            found.setdefault(node.parent, []).append(number)
        return found

    def children(self, number: int) -> list[int]:
        """The parts that hang on one, in the order in which they came."""
        return self._hanging.get(number, [])


def matches(tree: Tree, rule: Rule) -> list[Match]:
    """All places where a rule applies.

    Each name of the left graph stands for a part of its own. A rule that removes a part applies
    only where nothing else hangs on it.
    """
    order, inward = rule.left.order, rule.left.inward
    found = [
        match
        for number in tree.nodes
        if _fits(tree.nodes[number], rule.left.nodes[order[0]], None)
        for match in _completed(tree, rule, order[1:], inward, {order[0]: number})
    ]
    removed = [name for name in order if name not in rule.right.nodes]
    return [m for m in found if all(_is_free(tree, m, name) for name in removed)]


def _completed(
    tree: Tree, rule: Rule, names: list[str], inward: dict[str, Edge], so_far: Match
) -> Iterator[Match]:
    """Every way to find the other nodes of a left graph, parents first."""
    if not names:
        yield so_far
        return
    edge, label = inward[names[0]], rule.left.nodes[names[0]]
    for number in tree.children(so_far[edge.parent]):
        if number not in so_far.values() and _fits(tree.nodes[number], label, edge):
            yield from _completed(tree, rule, names[1:], inward, {**so_far, names[0]: number})


def _fits(node: Node, label: str, edge: Edge | None) -> bool:
    if label not in (ANY, node.label):
        return False
    wanted = () if edge is None else ("side", "joint", "mirror")
    return all(getattr(edge, name) in (None, getattr(node, name)) for name in wanted)


def _is_free(tree: Tree, match: Match, name: str) -> bool:
    return set(tree.children(match[name])) <= set(match.values())


def apply(tree: Tree, rule: Rule, match: Match, genes: Genes = ()) -> Tree:
    """The tree with the right graph of a rule in the place of its left graph.

    Args:
        tree: The parts so far.
        rule: The rule.
        match: One of `matches`.
        genes: What parts get that are new, or get another label.
    """
    nodes, newest = dict(tree.nodes), tree.newest
    number = dict(match)
    for name in rule.right.order:
        label = rule.right.nodes[name]
        if name not in number:
            newest += 1
            number[name] = newest
            nodes[newest] = Node(label, genes)
        elif label not in (ANY, nodes[number[name]].label):
            nodes[number[name]] = replace(nodes[number[name]], label=label, genes=genes)
        edge = rule.right.inward.get(name)
        if edge is not None:
            given = {k: getattr(edge, k) for k in ("side", "joint", "mirror")}
            told = {k: value for k, value in given.items() if value is not None}
            place = nodes[number[name]]
            nodes[number[name]] = replace(place, parent=number[edge.parent], **told)
    for name, old in match.items():
        if name not in rule.right.nodes:
            del nodes[old]
    return Tree(nodes, newest)


def choices(tree: Tree, grammar: Grammar, most: int) -> list[tuple[Rule, list[Match]]]:
    """The rules that apply, each with its places; none that gives more than so many parts."""
    room = most - len(tree.nodes)
    found = ((rule, matches(tree, rule)) for rule in grammar.rules if rule.adds <= room)
    return [(rule, places) for rule, places in found if places]


def derive(
    grammar: Grammar, steps: Iterable[tuple[float, float, Genes]], most: int = 64
) -> tuple[Tree, int]:
    """Rewrite the start by as many rules as there are steps, then finish what is unfinished.

    Afterwards rules that leave fewer unfinished parts are applied, the first that can, as long
    as there is one; what no such rule finishes stays as it is, and builds nothing.

    Args:
        grammar: The rules.
        steps: Each chooses a rule among those that apply and a place, by numbers in [0, 1], and
            has genes for the parts that it makes.
        most: Parts that a tree may have.

    Returns:
        The tree, and how many of the steps were used: no more than there were rules to apply.
    """
    tree, used, genes = Tree({0: Node(grammar.start)}), 0, ()
    for rule_gene, place_gene, genes in steps:
        possible = choices(tree, grammar, most)
        if not possible:
            break
        rule, places = _weighted(possible, rule_gene)
        match = places[min(int(place_gene * len(places)), len(places) - 1)]
        tree, used = apply(tree, rule, match, genes), used + 1
    return _finished(tree, grammar, genes, most), used


def _weighted(possible: list[tuple[Rule, list[Match]]], gene: float) -> tuple[Rule, list[Match]]:
    """The rule that a number in [0, 1] chooses, by their weights."""
    left = gene * sum(rule.weight for rule, _ in possible)
    for rule, places in possible:
        left -= rule.weight
        if left < 0.0:
            return rule, places
    return possible[-1]


def _finished(tree: Tree, grammar: Grammar, genes: Genes, most: int) -> Tree:
    closing = [rule for rule in grammar.rules if _unfinished(rule, grammar) < 0]
    while any(node.label not in grammar.cells for node in tree.nodes.values()):
        for rule in closing:
            places = matches(tree, rule) if len(tree.nodes) + rule.adds <= most else []
            if places:
                tree = apply(tree, rule, places[0], genes)
                break
        else:
            return tree
    return tree


def _unfinished(rule: Rule, grammar: Grammar) -> int:
    """How many more parts are unfinished after a rule."""
    done = (ANY, *grammar.cells)
    right, left = (
        sum(label not in done for label in side.nodes.values()) for side in (rule.right, rule.left)
    )
    return right - left
