"""`Planner`: the plans of a recording, made while it is made.

Light is made once, for both the look at it and the sensors.  What the cameras see at first is held until it is some
`HELD`; its plans, within a share of the tolerance, are what the recording begins with.  Each later instant is measured
as it goes by, and the same plans are asked for again, of all that was seen so far: now and then, and at the end.  If
what is left out is no longer within the tolerance, the plans leave out less, within a smaller share of it as long as
there may be more to come, the recording begins again, and light is not measured twice.

What is kept once is kept, and a camera of which all is kept is not looked at any more.  What is kept although it would
be within the tolerance, for the sake of what is still to come, says so in the plan.

**Cost**: the plan is what was asked for, whether it pays or not, and mostly it does not.  To look takes 5 to 10 ns per
pixel and frame, and several times that where all of it moves in every frame, what can be left out 1 to 2, and to begin
again what was recorded so far: CPU time of a conversion was 1.0 to 1.2 times that of all effects, and 1.3 times where
motion picked up and it began again (README).  Where the first plans keep all, no more than what is held is looked at.

**It is sound**: a recording is made by one plan from its beginning to its end, and in the end that plan's bounds hold
for the scene of the whole clip, as if it had been looked at first.

**It can be repeated**: what is decided, and where, follows from the light alone.  `looked` says how far; of a recording
that is taken up again, so much is looked at again, and the decisions are the same.

**Sources that pass once.** Standard input is planned as a file is: what it gives is kept, as it comes, for as long as
the recording may have to begin again, and beyond `KEPT` all effects are.  A camera waits for nobody: it is planned if
it ends while it is held, else all is kept.  Effects cannot come and go while a recording is made, not even if each
chunk of light is measured before the sensors see it.  Where thresholds differ from pixel to pixel or crossing to
crossing, as in all real sensors, two recordings of a pixel that disagree about one event go on with other levels, and
an effect that comes back does not bring them together (`bounds.scene`: echo).  Let the chance of that be q > 0 in
some pixel, however few events it has had: if from then on that pixel alone sees light that changes, the distance of
the whole tends, with probability q, to that of recordings with nothing in common, though nothing is left out any
more.  So no bound on what was is one on the whole, unless q is 0 in every pixel.  Of an effect that costs something a
chunk can show that of the refractory period alone, which costs less than measuring does.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Generator, Sequence
from contextlib import closing
from dataclasses import replace

from vid2ev.plan.plan import Plan, check_tolerance
from vid2ev.plan.recordings import PASSES, Look, left_of, plans_unseen
from vid2ev.seen.instants import Instant, instants
from vid2ev.seen.recipe import Recipe
from vid2ev.sensors.devices import CPU, Device

HELD = 1 << 26  # bytes of light, at least an instant
KEPT = 1 << 32  # bytes of standard input
SPARE = 0.5  # share of the tolerance for the first plans, and again each time: what comes may be worse yet
SPARED = "kept, as some of the tolerance was spared for what was still to come"
LONG = "the source passes once, and more than 4 GiB of it are not kept to begin again"
REVISIONS = 2  # after so many all is kept: each costs the recording so far


class Planner:
    """The plans of a recipe's cameras within a tolerance of the distance: `begin`, then go through `instants` and show
    each to `see`; after the last, `finish`.  Where these return True the recording has to begin again by new `plans`.

    `threads` see and measure, and change nothing but the time it takes.  Light is made on the `device`, and comes back
    to be looked at.
    """

    def __init__(self, recipe: Recipe, tolerance: float, threads: int = 1, device: Device = CPU):
        check_tolerance(tolerance)
        self.recipe, self.tolerance, self.device, self._threads = recipe, tolerance, device, threads
        self.plans: dict[str, Plan] = {}
        self.looked, self.ended = 0, False  # instants, from the first on; and whether the last of them was the last
        self._kept = recipe.source.kept
        self._look, self._looking = Look(recipe, threads), {mount.name for mount in recipe.mounts}
        self._bytes, self._due, self._revisions = 0, 2 * HELD, 0
        self._spared: dict[str, frozenset[str]] = {}
        self._held: deque[Instant] = deque()
        self._rest: Generator[Instant] | None = None

    @property
    def left(self) -> Recipe:
        """The recipe with what the plans leave of the sensors."""
        return left_of(self.recipe, self.plans)

    def begin(self, looked: int = 0, ended: bool = False) -> None:
        """Make the first plans; those at which another planner was that had looked so far."""
        if self.plans:
            return
        if self._kept:
            self._kept.wanted = True
        self._rest = self._from(0)
        more = self._hold(self._rest)
        once = self._kept is None and not self.recipe.source.rewindable
        if not self.looked or (more and once):
            self.plans = plans_unseen(self.recipe, PASSES, "auto", self.tolerance)
        else:
            self._take(self._decided(more))
        if not more or once:
            self._looking.clear()
        if self._looking and looked > self.looked:
            self._catch_up(self._rest, looked)
        if ended:
            self.finish()
            self._let_go()

    def instants(self, frame: int = 0) -> Generator[Instant]:
        """What the cameras see at source frame `frame`, and after it."""
        if frame > 0:
            self._let_go()
        if self._kept and not self._looking:
            self._kept.wanted = False
        held, rest, self._held, self._rest = self._held, self._rest, deque(), None
        rest = rest or self._from(frame)
        with closing(rest):
            while held:
                yield held.popleft()
            yield from rest

    def _from(self, frame: int) -> Generator[Instant]:
        return instants(self.recipe, frame, self.device, self._threads)

    def see(self, instant: Instant, index: int) -> bool:
        """Look at an instant, the one after so many of the recording; returns whether there are new plans."""
        if not self._looking or index < self.looked:
            return False
        self._measure(instant)
        if self._kept and self._kept.size > KEPT:
            return self._keep_all()
        if self._bytes < self._due:
            return False
        self._due *= 2
        return self._revise(more=True)

    def finish(self) -> bool:
        """After the last instant: the plans of all that was seen; returns whether they are new."""
        self.ended = True
        return bool(self._looking) and self._revise(more=False)

    def _hold(self, coming: Generator[Instant]) -> bool:
        """Look at the first instants and keep them; returns whether there may be more."""
        for instant in coming:
            self._held.append(instant)
            self._measure(instant)
            if self._bytes >= HELD:
                return True
        return False

    def _catch_up(self, coming: Generator[Instant], looked: int) -> None:
        """Look at as many instants as were looked at."""
        for instant in coming:
            self.see(instant, self.looked)
            if not self._looking or self.looked >= looked:
                break
        self._let_go()

    def _let_go(self) -> None:
        """Drop what is held."""
        if self._rest is not None:
            self._rest.close()
        self._held, self._rest = deque(), None

    def _measure(self, instant: Instant) -> None:
        self._look.see(instant.downloaded())
        self._bytes += sum(frame.light.nbytes for frame in instant.frames)
        self.looked += 1

    def _decided(self, more: bool, among: dict[str, Sequence[str]] | None = None) -> dict[str, Plan]:
        """Plans of all that was seen; some of the tolerance is spared if there may be `more` to see."""
        found = self._look.plans("auto", self.tolerance, among)
        if not more:
            return found
        whole, found = found, self._look.plans("auto", self.tolerance * SPARE ** (1 + self._revisions), among)
        for name, plan in found.items():
            self._spared[name] = self._spared.get(name, frozenset()) | {*whole[name].gone} - {*plan.gone}
        return {name: replace(plan, tolerance=self.tolerance) for name, plan in found.items()}

    def _revise(self, more: bool) -> bool:
        """Make the plans again, of no more than they leave out; returns whether any of them is another."""
        among: dict[str, Sequence[str]] = {name: self.plans[name].gone for name in self._looking}
        found = self._look.plans("auto", self.tolerance, among)
        new = [name for name, plan in found.items() if plan.spec != self.plans[name].spec]
        if new:
            self._revisions += 1
            for name in new:
                among[name] = _steady(self.plans[name], found[name]) if self._revisions < REVISIONS else ()
            decided = self._decided(more, among)
            found |= {name: decided[name] for name in new}
        self._take(found)
        return bool(new)

    def _keep_all(self) -> bool:
        """Leave nothing out any more, and look no further; returns that there are new plans."""
        kept = plans_unseen(self.recipe, LONG, "auto", self.tolerance)
        self.plans |= {name: kept[name] for name in self._looking}
        self._looking.clear()
        return True

    def _take(self, found: dict[str, Plan]) -> None:
        """Go by these plans, and look only at what cameras see of which something is left out."""
        self.plans |= {name: plan.kept_for(self._spared.get(name, ()), SPARED) for name, plan in found.items()}
        for name in [name for name in self._looking if not self.plans[name].gone]:
            self._look.forget(name)
            self._looking.discard(name)


def _steady(plan: Plan, later: Plan) -> list[str]:
    """What a plan leaves out whose place is taken by the same in a later one."""
    took = {row.effect: row.omission for row in plan.rows if row.effect in plan.gone}
    return [row.effect for row in later.rows if row.effect in took and row.omission.replace == took[row.effect].replace]
