"""How messages say things."""


def some_names(names, *, at_most=3):
    """'a, b, c and 4 more': names enough to look for, not a page of them."""
    shown = ", ".join(names[:at_most])
    rest = len(names) - at_most
    return f"{shown} and {rest} more" if rest > 0 else shown
