"""`antdrive worlds list`."""

import json

from antdrive.worlds import list_worlds
from tests.cli.calling import Call


def test_every_world_is_listed(antdrive: Call) -> None:
    assert "han2007-aco" in antdrive("worlds", "list")[1]
    code, out, err = antdrive("worlds", "list", "--json")
    assert (code, err) == (0, "")
    assert list(json.loads(out)) == list(list_worlds())
