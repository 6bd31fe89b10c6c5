"""Plain: trained in one go on the photos as taken; then in rounds, if there are any."""

from alignerf.methods import rounds


class Plain(rounds.Rounds):
    """Any method without a key of another record."""

    from_scratch = True


METHOD = Plain()
