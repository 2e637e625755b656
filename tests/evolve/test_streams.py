import numpy as np
import pytest

from evolve.streams import Role, Streams


def test_a_stream_depends_on_its_name_only():
    first = Streams(7)(3, Role.MUTATION, 5).random(4)
    Streams(7)(0, Role.INITIAL).random(100)
    np.testing.assert_array_equal(first, Streams(7)(3, Role.MUTATION, 5).random(4))


def test_every_part_of_the_name_and_the_seed_matter():
    names = [(g, role, i) for g in range(3) for role in Role for i in range(3)]
    draws = {(seed, *n): Streams(seed)(*n).random() for seed in range(3) for n in names}
    assert len(set(draws.values())) == len(draws)


def test_the_numbers_are_those_of_the_first_version():
    # A record made today must be continued with the same numbers tomorrow.
    drawn = Streams(1)(2, Role.CROSSOVER, 0).integers(1 << 32, size=3)
    sequence = np.random.SeedSequence(1, spawn_key=(2, 2, 0))
    expected = np.random.Generator(np.random.Philox(sequence)).integers(1 << 32, size=3)
    np.testing.assert_array_equal(drawn, expected)


def test_a_negative_seed_is_refused():
    with pytest.raises(ValueError, match="seed must be a whole number >= 0, not -1"):
        Streams(-1)
