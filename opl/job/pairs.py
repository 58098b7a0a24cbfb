"""Pairs of bodies by the names that a cell file gives them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

from opl.cell.workcell import PART, WHEEL, PairRules
from opl.errors import InputError
from opl.job.source import Source

ROBOT = "robot"  # every link
FIXTURE = "fixture"  # every body of the job's own fixture

Names = tuple[str, ...]
Given = tuple[Names, float | None]  # None: may touch


@dataclass(frozen=True)
class PairNames:
    """What there is to be named in a cell.

    Attributes:
        links: Links of the robot, from the foot to the flange.
        held: Bodies of the gripper.
        wheels: The wheels.
        obstacles: What else stands around.
        fixture: Bodies of the job's own fixture, once it is known.
    """

    links: Names
    held: Names
    wheels: Names
    obstacles: Names
    fixture: Names = ()

    @property
    def known(self) -> Names:
        """Every name that a pair may be given by."""
        own = (ROBOT, PART, FIXTURE, *self.held, *self.wheels, *self.obstacles)
        return (*own, *self.links)

    def meant(self, name: str) -> Names:
        """Return the links or bodies that a name stands for."""
        return {ROBOT: self.links, FIXTURE: self.fixture}.get(name, (name,))

    def move_apart(self, first: str, second: str) -> bool:
        """Return whether two links or bodies can move against each other, or share a bearing."""
        places = sorted((self._place(first), self._place(second)))
        if first in self.links and second in self.links:
            return places[1] - places[0] > 1
        return places[0] != places[1]

    def _place(self, name: str) -> int:
        """Return the link that a thing moves with, counted from the foot."""
        if name in self.links:
            return self.links.index(name)
        return 0 if name in (*self.wheels, *self.obstacles) else len(self.links) - 1


@dataclass(frozen=True)
class GivenPairs:
    """The pairs that a cell file gives, by its own names.

    Attributes:
        names: What there is to be named.
        given: Pairs and the distance to keep between them in [m], None if they may touch.
    """

    names: PairNames
    given: tuple[Given, ...]

    def rules(self, wheel: str, fixture: Names) -> PairRules:
        """Return the rules by the names that collisions are reported with.

        A single pair goes before one of all links or of the whole fixture.

        Args:
            wheel: The wheel that is picked.
            fixture: The bodies of the job's own fixture.
        """
        names = replace(self.names, fixture=fixture)
        needed: dict[frozenset[str], float | None] = {}
        for pair, distance in sorted(self.given, key=lambda one: is_single(one[0])):
            for both in product(*map(names.meant, pair)):
                needed[frozenset(WHEEL if name == wheel else name for name in both)] = distance
        return PairRules(
            frozenset(pair for pair, distance in needed.items() if distance is None),
            {pair: distance for pair, distance in needed.items() if distance is not None},
        )


NO_PAIRS = GivenPairs(PairNames((), (), (), ()), ())


def is_single(pair: Names) -> bool:
    """Return whether both names stand for one body each."""
    return not {ROBOT, FIXTURE} & set(pair)


def given_pairs(
    source: Source,
    names: PairNames,
    allowed: Sequence[Names],
    clearances: Sequence[tuple[Names, float]],
) -> GivenPairs:
    """Check the pairs of a cell file.

    Args:
        source: The cell file or mapping.
        names: What there is to be named.
        allowed: Of ``allowed_contacts``.
        clearances: Of ``pair_clearances``, in [m].

    Raises:
        InputError: If a name is unknown, or a pair is given twice or makes no sense.
    """
    given: list[tuple[str, Names, float | None]] = [
        (f"allowed_contacts.{place}", pair, None) for place, pair in enumerate(allowed)
    ]
    given += [
        (f"pair_clearances.{place}.pair", pair, distance)
        for place, (pair, distance) in enumerate(clearances)
    ]
    seen: dict[frozenset[str], str] = {}
    for key, pair, distance in given:
        where = source.at(key)
        for name in pair:
            if name not in names.known:
                known = ", ".join(names.known)
                raise InputError(where, f"no body {name!r} in the cell; have: {known}")
        fault = ""
        if frozenset(pair) in seen:
            fault = f"are given in {seen[frozenset(pair)]} already"
        elif pair[0] == pair[1]:
            fault = "are one and the same"
        elif distance is None and PART in pair and set(pair) & set(names.wheels):
            fault = "how deep a part may sink into the belt is the wheel's max_belt_penetration_mm"
        elif distance is not None and is_single(pair) and not names.move_apart(*pair):
            fault = (
                "do not move against each other, or share a bearing: no distance between them is "
                "looked at"
            )
        if fault:
            raise InputError(where, f"{' and '.join(pair)}: {fault}")
        seen[frozenset(pair)] = key
    return GivenPairs(names, tuple((pair, distance) for _, pair, distance in given))
