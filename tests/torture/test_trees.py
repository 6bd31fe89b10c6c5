"""Nothing of a user's is touched: trees of folders and links, and every command."""

import pytest

from tests.torture import trees


@pytest.mark.parametrize("first", range(0, 300, 50))
def test_nothing_of_a_user_changes(first, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = [trees.attack(number, 20261126) for number in range(first, first + 50)]
    assert [one for one in found if one] == []
