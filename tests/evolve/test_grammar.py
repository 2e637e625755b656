"""Graph grammars: derivations against graphs drawn by hand, mirrored bodies, files of rules."""

from __future__ import annotations

import json

import numpy as np
import pytest

from evolve import Evaluator, load
from evolve.bodies.build import robot
from evolve.bodies.cells import Cells
from evolve.bodies.derivation import Node, Tree, apply, derive, matches
from evolve.bodies.graph_grammar import Grammar, load_grammar
from evolve.bodies.limbs import GENES, build
from evolve.encodings import ENCODINGS
from evolve.encodings.evolving import BodySettings
from evolve.errors import ConfigError
from evolve.toml import dump, parse
from warp_springs.config import tables

LEGGED = load_grammar("legged")
RULES = {rule.name: rule for rule in LEGGED.rules}
MIDDLE = (0.0, 0.0, 0.0, 0.5, 0.5, 0.5, 0.7, 0.5)
"""Genes of parts in step with their twins."""


def derived(*names, tree=None):
    """The tree after rules, each at the first place where it applies."""
    tree = tree or Tree({0: Node(LEGGED.start)})
    for name in names:
        tree = apply(tree, RULES[name], matches(tree, RULES[name])[0], MIDDLE)
    return tree


def drawn(tree, number=0):
    """A tree as text: label, and in brackets its children with side, joint and a * for mirrored."""
    node = tree.nodes[number]
    inner = ", ".join(drawn(tree, child) for child in tree.children(number))
    how = "" if node.parent < 0 else f"{node.side}{'*' * node.mirror}/{node.joint} "
    return f"{how}{node.label}" + (f"({inner})" if inner else "")


def test_a_derivation_gives_the_graphs_drawn_by_hand():
    first = derived("a robot is a segment with limbs, and more behind")
    assert drawn(first) == "trunk(left*/hip Limb, tip/waist Spine)"
    longer = derived("a thigh", "a shin with a foot", "a segment without limbs", tree=first)
    leg = "left*/hip thigh(tip/knee shin(tip/none foot))"
    assert drawn(longer) == f"trunk({leg}, tip/waist trunk(tip/waist Spine))"
    other = derived(
        "a hip becomes a shoulder", "no more segments", "a waist becomes a flank", tree=longer
    )
    assert drawn(other) == f"trunk({leg.replace('hip', 'shoulder')}, tip/flank trunk)"
    assert drawn(first) == "trunk(left*/hip Limb, tip/waist Spine)", "trees are not changed"


def test_rules_apply_in_all_their_places_and_nowhere_else():
    tree = derived(
        "a robot is a segment with limbs, and more behind", "a segment with limbs", "a thigh"
    )
    assert len(matches(tree, RULES["a thigh"])) == 1 and not matches(
        tree, RULES["a robot is a segment with limbs, and more behind"]
    )
    assert len(matches(tree, RULES["a waist becomes a flank"])) == 2
    # Something hangs on it: it cannot be removed.
    data = tables(LEGGED)
    data["rules"] = [
        {
            "name": "cut",
            "left": {
                "nodes": {"a": "*", "t": "thigh"},
                "edges": [{"parent": "a", "child": "t"}],
            },
            "right": {"nodes": {"a": "*"}},
        }
    ]
    cut = Grammar.model_validate(data | {"start": "trunk"}).rules[0]
    assert not matches(tree, cut)
    bare = derived("no shin", tree=tree)
    (place,) = matches(bare, cut)
    assert "thigh" not in drawn(apply(bare, cut, place))


def test_genes_choose_by_weight_and_a_derivation_is_finished():
    steps = [(0.0, 0.0, MIDDLE)]
    tree, used = derive(LEGGED, steps)
    assert used == 1 and drawn(tree) == "trunk(left*/hip shin, tip/waist head)"
    grammar = LEGGED.model_copy(update={"rules": LEGGED.rules[1:5], "start": "Spine"})
    shares = {}
    for gene in np.linspace(0.0, 1.0, 2001):
        tree, _ = derive(grammar, [(gene, 0.0, MIDDLE)])
        found = tree.nodes[0].label, len(tree.nodes)
        shares[found] = shares.get(found, 0.0) + 1.0 / 2001
    # Weights 2, 1, 1/2 and 1/2: two kinds of segments, whose rest is finished, a head, a tail.
    assert shares[("head", 1)] == pytest.approx(0.125, abs=0.01)
    assert shares[("tail", 1)] == pytest.approx(0.125, abs=0.01)


def built(tree, **limits):
    options = {"edge": 0.1, "most": 30, "extent": 3.0} | limits
    return build(tree, LEGGED, Cells(**options))


def test_mirrored_limbs_make_a_body_its_own_mirror_image_and_it_moves_so():
    tree = derived(
        "a robot is a segment with limbs, and more behind", "a thigh", "a shin with a foot",
        "a segment with limbs", "a thigh", "a shin", "a hip becomes a shoulder",
    )  # fmt: skip
    cells = built(tree)
    assert len(cells) == 1 + 2 * 5 + 2 + 2 * 4
    body = robot(cells.plan(), BodySettings())
    image = body.positions * [1.0, -1.0, 1.0]
    gap = np.linalg.norm(image[:, None] - body.positions, axis=2)
    assert gap.min(axis=1).max() < 1e-6
    twin = gap.argmin(axis=1)
    course = body.amplitude * np.exp(1j * body.phase)
    pairs = {tuple(sorted(p)): c for p, c in zip(body.springs.tolist(), course, strict=True)}
    mirrored = [pairs[tuple(sorted(twin[list(p)].tolist()))] for p in body.springs.tolist()]
    np.testing.assert_allclose(mirrored, course, atol=1e-9)
    assert np.abs(course).max() > 0.005


def test_a_twin_moves_later_by_its_gene():
    genes = list(MIDDLE)
    genes[GENES.index("twin")] = 0.25
    tree = derived("a robot is a segment with limbs, and more behind")
    tree = apply(tree, RULES["a limb of one part"], {"l": 1}, tuple(genes))
    body = robot(built(tree).plan(), BodySettings())
    left, right = (
        body.positions[body.springs].mean(axis=1)[:, 1] * side > 0.06 for side in (1, -1)
    )
    moving = body.amplitude > 1e-6
    phases = [np.unique(np.round(body.phase[side & moving] / np.pi, 6)) for side in (left, right)]
    # A hip swings to and fro: two phases on either side, a quarter of a cycle apart.
    np.testing.assert_allclose(phases[0], [0.0, 1.0])
    np.testing.assert_allclose(phases[1], [0.5, 1.5])


def test_a_pair_of_limbs_comes_whole_or_not_at_all():
    tree = derived("a robot is a segment with limbs, and more behind", "a thigh", "a shin")
    for most in range(1, 10):
        centres = built(tree, most=most).centres
        assert len(centres) <= most
        assert np.abs(np.sort(centres[:, 1]) + np.sort(centres[:, 1])[::-1]).max() < 1e-9


def test_whatever_is_derived_keeps_to_the_limits():
    cls = ENCODINGS["grammar"]
    encoding = cls(None, cls.Settings(most_springs=200, largest_extent=0.7, most_steps=40))
    genomes = encoding.random(150, np.random.Generator(np.random.Philox(4)))
    robots = encoding.express(genomes)
    assert max(one.n_springs for one in robots) <= 200
    assert max(np.ptp(one.positions, axis=0).max() for one in robots) <= 0.7 + 1e-6
    for genome in genomes:
        tree, used = encoding.derivation(genome)
        assert used <= 40 and all(node.label in LEGGED.cells for node in tree.nodes.values())


TOY = {
    "start": "Chain",
    "cells": {"link": {"length": [0.8, 1.2], "moves": "bend"}},
    "rules": [
        {
            "name": "on",
            "left": {"nodes": {"c": "Chain"}},
            "right": {
                "nodes": {"c": "link", "n": "Chain"},
                "edges": [{"parent": "c", "child": "n"}],
            },
        },
        {"name": "end", "left": {"nodes": {"c": "Chain"}}, "right": {"nodes": {"c": "link"}}},
    ],
}


def run_of(path):
    own = f'name = "own"\n[encoding]\ntype = "grammar"\ngrammar = "{path}"\nmost_steps = 6\n'
    return own + '[optimizer]\ntype = "random"\n'


def test_rules_of_ones_own_come_from_a_file_and_stay_with_the_run(tmp_path):
    (tmp_path / "chain.json").write_text(json.dumps(TOY), encoding="utf-8")
    (tmp_path / "run.toml").write_text(run_of("chain.json"), encoding="utf-8")
    config = load(tmp_path / "run.toml", {"population": 4, "task.measure": 1.0})
    (tmp_path / "chain.json").unlink()
    again = parse(dump(config), "run.toml")
    assert again == config and again.encoding.loaded().start == "Chain"
    encoding = again.make_encoding()
    bodies = encoding.express(encoding.random(4, np.random.Generator(np.random.Philox(2))))
    assert all(body.n_springs <= 28 + 22 * 6 for body in bodies)
    assert np.isfinite(Evaluator(again)(bodies).fitness).all()


def broken(**changes):
    data = json.loads(json.dumps(TOY))
    for key, value in changes.items():
        *path, last = key.split("__")
        table = data
        for step in path:
            table = table[int(step)] if isinstance(table, list) else table[step]
        table[last] = value
    return json.dumps(data)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{", r"not valid JSON"),
        ("[]", r"expected an object"),
        (broken(start="Robot"), r"start: no rule rewrites 'Robot', and it is no cell"),
        (broken(rules__1__right={"nodes": {"c": "lnk"}}), r"rule 'end': no rule rewrites 'lnk'"),
        (broken(rules__1__right={"nodes": {"d": "link"}}), r"is 'c' on the left and 'd' on the"),
        (broken(rules__1__right={"nodes": {"c": "*"}}), r"rule 'end': 'c' = '\*' on the right"),
        (broken(rules__0__right={"nodes": {"c": "link", "n": "Chain"}}), r"'n' does not hang tog"),
        (
            broken(rules__0__right__edges=[{"parent": "c", "child": "x"}]),
            r"rules.0.right: an edge names 'x', nodes are c, n",
        ),
        (
            broken(rules__0__right__edges=[{"parent": "c", "child": "n", "joint": "hip"}]),
            r"rule 'on': there is no joint 'hip', joints are none",
        ),
        (
            broken(rules__0__right__edges=[{"parent": "c", "child": "n", "mirror": True}]),
            r"mirror: only left and right have an opposite side",
        ),
        (
            broken(rules__0__right__edges=[{"parent": "c", "child": "n", "side": "top"}]),
            r"rules.0.right.edges.0.side: input should be 'tip'",
        ),
        (broken(cells={"link": {"length": [2.0, 1.0]}}), r"length = \[2, 1\] given, expected two"),
        (broken(cells={"link": {"legth": [1.0, 1.0]}}), r"legth"),
    ],
)
def test_broken_rules_are_refused_in_one_clear_line(tmp_path, text, words):
    (tmp_path / "mine.json").write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=words) as error:
        parse(run_of("mine.json"), "run.toml", folder=tmp_path)
    assert "\n" not in str(error.value) and "mine.json" in str(error.value)


def test_a_grammar_that_is_not_there_is_named():
    with pytest.raises(ConfigError, match="there is no grammar 'legs'; grammars are legged"):
        parse(run_of("legs"), "run.toml")
    with pytest.raises(ConfigError, match=r"there is no file .*gone\.toml"):
        parse(run_of("gone.toml"), "run.toml")
