"""Placeholders of a command or a path: names in braces, replaced by values."""

import re

# A doubled brace is that brace itself.
PLACEHOLDER = re.compile(r"\{\{|\}\}|\{(\w*)\}|[{}]")
DOUBLED = ("{{", "}}")


def names(text):
    """The names, in their order; each as often as it stands there."""
    return [found[1] for found in PLACEHOLDER.finditer(text) if found[1]]


def check(text, known):
    """ValueError for a name that is none of `known`, and for an unpaired brace."""
    for found in PLACEHOLDER.finditer(text):
        if found[0] not in DOUBLED and found[1] not in known:
            raise ValueError(
                f"{found[0]} means nothing; in braces only {', '.join(known)}, and a "
                "brace itself is written twice"
            )


def filled(text, values):
    """The text with {name: value} put in; nothing of a value is read again."""

    def value(found):
        if found[0] in DOUBLED:
            return found[0][0]
        return str(values[found[1]])

    return PLACEHOLDER.sub(value, text)
