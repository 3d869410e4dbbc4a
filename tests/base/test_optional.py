"""Optional packages: what lacks one names the extra that installs it."""

import pytest

from antdrive.base.errors import InputError
from antdrive.base.optional import optional


def test_what_is_missing_is_named_with_its_extra() -> None:
    with pytest.raises(
        InputError, match=r"^no_such_package: not installed; pictures need it: pip install 'antdrive\[pics\]'$"
    ):
        optional("no_such_package.part", "pics", "pictures need it")


def test_what_is_there_is_given() -> None:
    import json.decoder

    assert optional("json.decoder", "any", "nothing") is json.decoder
