"""The torture's minutes: what each part may use, and what it leaves to those after."""

import math
import time


class Clock:
    """Hands out minutes by shares; without a limit everything has time.

    minutes: of the whole, 0 for no limit. shares: {part: its share}, in the order in
    which parts begin. A part that ends early leaves its time to all that follow.
    """

    def __init__(self, minutes, shares, now=time.monotonic):
        self.now, self.shares = now, dict(shares)
        self.end = now() + 60 * minutes if minutes else math.inf
        self.until = math.inf

    @property
    def is_limited(self):
        return self.end < math.inf

    def begin(self, part):
        """Give a part its share of the time that is left."""
        share, now = self.shares.pop(part), self.now()
        part_of = share / (share + sum(self.shares.values()))
        self.until = now + max(self.end - now, 0) * part_of

    def of_next(self, among=1):
        """When the next of so many things of a part has to stop."""
        now = self.now()
        return now + max(self.until - now, 0) / among

    def has_room(self, minutes):
        """Whether what cannot be cut, and takes so long, still fits into the whole.

        A little more than is left will do: a machine may be faster than the estimate.
        """
        return (self.end - self.now()) >= 60 * minutes / 2
