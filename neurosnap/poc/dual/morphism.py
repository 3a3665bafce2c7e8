"""Maps between sets of sensors that preserve implications, and what they do to states.

A morphism keeps order, complement and minimum. It is given by where it sends each
sensor; complements and bounds follow, so the only thing that can be wrong is the
order, and that is checked before a morphism exists.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.poc.dual.mask_dual import Dual
from neurosnap.poc.order.literal_sets import Literals
from neurosnap.poc.order.pocset import Element, PocSet


class PocMorphism:
    """A poc morphism ([GK] defn:poc morphism).

    Args:
        source: Where it is from.
        target: Where it goes.
        images: For each sensor of the source, one after another, the element it is
            sent to: a literal's name or number, or one of the target's bounds,
            ``target.minimum`` and ``target.maximum``.

    Raises:
        UnknownSensorError: A name is not among the sensors.
        ShapeError: There is not one image a sensor.
        InvalidValueError: A pair's order is not kept; the pair is named.

    Examples:
        >>> p, q = PocSet.parse("a, b : a < b"), PocSet.parse("a, b : a* < b")
        >>> f = PocMorphism(p, q, ["a*", "b"])
        >>> f("b*"), f.is_bijective
        ('b*', True)
    """

    def __init__(
        self,
        source: PocSet,
        target: PocSet,
        images: Iterable[Element],
    ) -> None:
        self._source = source
        self._target = target
        own = np.array([target.element(image) for image in images], np.int64)
        if len(own) != len(source):
            raise ShapeError("images", f"must be {len(source)}, one a sensor", len(own))
        self._images = np.stack([own, own ^ 1], axis=1).reshape(-1)
        self._images.flags.writeable = False
        self._refuse_disorder()

    @classmethod
    def named(cls, source: PocSet, target: PocSet) -> "PocMorphism":
        """Return the morphism that sends each sensor to the one of the same name.

        With the same names in both it is a degeneration: the target has all relations
        of the source, and more ([GK] example:degeneration). With fewer in the source
        it is the inclusion of a poc subset.

        Raises:
            UnknownSensorError: The target lacks a name.
            InvalidValueError: It lacks a relation.

        Examples:
            >>> p = PocSet.parse("a, b, c : a < c, b < c")
            >>> PocMorphism.named(p, PocSet.parse("a, b, c : a < b < c")).is_bijective
            True
        """
        return cls(source, target, source.sensorium.names)

    @property
    def source(self) -> PocSet:
        """Where it is from."""
        return self._source

    @property
    def target(self) -> PocSet:
        """Where it goes."""
        return self._target

    @property
    def images(self) -> NDArray[np.int64]:
        """``(2N,)``, read-only: the element each literal is sent to."""
        return self._images

    def __call__(self, element: Element) -> str:
        """Return the name of what an element is sent to; bounds are "0" and "1"."""
        return self._target.name(self.image(element))

    def image(self, element: Element) -> int:
        """Return the number of what an element is sent to."""
        number = self._source.element(element)
        if number >= self._source.minimum:
            return self._target.minimum + (number - self._source.minimum)
        return int(self._images[number])

    def after(self, first: "PocMorphism") -> "PocMorphism":
        """Return the composition: `first`, then this one. Written ``this @ first``.

        Raises:
            InvalidValueError: `first` does not go where this one is from.
        """
        if first.target != self._source:
            rule = f"must go to {str(self._source)!r}"
            raise InvalidValueError("morphism", rule, str(first.target))
        images = [self.image(int(image)) for image in first.images[::2]]
        return PocMorphism(first.source, self._target, images)

    def __matmul__(self, first: "PocMorphism") -> "PocMorphism":
        return self.after(first)

    def dual(self, u: Literals) -> NDArray[np.bool_]:
        """Return the dual map of a vertex of the target's dual: what is sent into it.

        [GK] defn:dual map; preserves medians, and turns compositions around.

        Returns:
            ``(2N,)`` bool, a vertex of the source's dual.

        Raises:
            InvalidValueError: `u` is no vertex.

        Examples:
            >>> p, q = PocSet.parse("a, b"), PocSet.parse("x")
            >>> PocMorphism(p, q, ["x", q.minimum]).dual([0])
            array([ True, False, False,  True])
        """
        dual = Dual(self._target)
        held = np.append(dual.array(dual.vertex("u", u)), [False, True])
        pulled: NDArray[np.bool_] = held[self._images]
        return pulled

    @property
    def is_injective(self) -> bool:
        """Whether different elements have different images."""
        order, target = self._source.order, self._target
        elements = [*range(len(order)), self._source.minimum, self._source.maximum]
        for a in elements:
            for b in elements[:a]:
                same = target.equal(self.image(a), self.image(b))
                if same and not self._source.equal(a, b):
                    return False
        return True

    @property
    def is_surjective(self) -> bool:
        """Whether every element of the target is an image."""
        reached = {int(image) for image in self._images}
        literals = range(self._target.minimum)
        return all(any(self._target.equal(a, b) for b in reached) for a in literals)

    @property
    def is_bijective(self) -> bool:
        """Whether it is injective and surjective; its inverse may keep less order."""
        return self.is_injective and self.is_surjective

    @property
    def is_isomorphism(self) -> bool:
        """Whether it is bijective and its inverse is a morphism too."""
        if not self.is_bijective:
            return False
        return all(
            self._source.leq(a, b) or not self._target.leq(self.image(a), self.image(b))
            for a in range(self._source.minimum)
            for b in range(self._source.minimum)
        )

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, PocMorphism):
            return NotImplemented
        if (self._source, self._target) != (other.source, other.target):
            return False
        pairs = zip(self._images.tolist(), other.images.tolist(), strict=True)
        return all(self._target.equal(a, b) for a, b in pairs)

    def __hash__(self) -> int:
        return hash((self._source, self._target))

    def __repr__(self) -> str:
        names = self._source.sensorium
        sent = ", ".join(f"{name} ↦ {self(name)}" for name in names)
        return f"PocMorphism({str(self._source)!r} → {str(self._target)!r}, {sent})"

    def _refuse_disorder(self) -> None:
        """Raise if some ``a <= b`` is not kept; edges of the graph are enough."""
        for a, b in np.argwhere(self._source.graph.edges).tolist():
            x, y = self.image(a), self.image(b)
            if not self._target.leq(x, y):
                p, q = self._source, self._target
                rule = f"must keep the order, and {p.name(a)} <= {p.name(b)}"
                shown = f"{q.name(x)} not <= {q.name(y)}"
                raise InvalidValueError("morphism", rule, shown)


def canonical_projection(poc: PocSet) -> PocMorphism:
    """Return the projection of a weak poc set onto its canonical quotient.

    [GK] lemma:canonical poc quotient: every morphism to a poc set factors through it.
    The quotient, its ``target``, has a sensor per proper element: negligible literals
    become the minimum, ubiquitous ones the maximum, and equal literals are named after
    the first of them.

    Examples:
        >>> f = canonical_projection(PocSet.parse("a, b, c : a < a*, b = c*"))
        >>> f.target, f("a"), f("c")
        (PocSet.parse('b'), '0', 'b*')
    """
    kept = [poc.name(a) for a in poc.heads.tolist() if not a & 1]
    quotient = poc.restricted(kept)
    head = poc.graph.representative
    negligible, ubiquitous = poc.negligible, poc.ubiquitous
    images: list[Element] = []
    for a in range(0, poc.minimum, 2):
        if negligible[a]:
            images.append(quotient.minimum)
        elif ubiquitous[a]:
            images.append(quotient.maximum)
        else:
            images.append(poc.name(int(head[a])))
    return PocMorphism(poc, quotient, images)
