"""What became of mutants, kept in a file line by line, so that an interrupted run goes on where it ended."""

from __future__ import annotations

import functools
import hashlib
import json
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, ValidationError

from tools.mutants.operators import Mutant
from tools.mutants.plans import PLANS, ROOT
from tools.mutants.running import SOURCE

Fate = Literal["killed", "timeout", "alive"]


class ResultsUnfit(Exception):
    """A file of results that this program has not written."""


class Judged(BaseModel):
    """What became of one mutant, and what it depended on.

    Attributes:
        file: the changed file, relative to the root of the project
        function: the function that holds the fault
        operator: the kind of fault
        line: the first line that is changed, from 1
        was: the lines as they were
        now: the lines as they are
        fate: "killed", "timeout" or "alive"
        source: a hash of the unchanged file
        tests: a hash of the tests
    """

    model_config = ConfigDict(extra="forbid", frozen=True)
    file: str
    function: str
    operator: str
    line: int
    was: str
    now: str
    fate: Fate
    source: str
    tests: str


class Results:
    """The fates that a file of results holds.

    A fate holds as long as the changed file is the same. A mutant that was alive is judged again once its tests have changed; one
    that was killed is not, as tests are added and seldom taken away. For a record that depends on nothing older begin a new file.
    """

    def __init__(self, path: Path | None, root: Path = ROOT) -> None:
        self._path, self._root = path, root
        self._known: dict[tuple[str, str, str, str], Judged] = {}
        if path is None or not path.exists():
            return
        for number, line in enumerate(path.read_text().splitlines(), 1):
            try:
                entry = Judged.model_validate_json(line)
            except ValidationError as error:
                raise ResultsUnfit(f"{path}: line {number}: not a result of make mutants") from error
            self._known[entry.file, entry.function, entry.was, entry.now] = entry

    def fate(self, mutant: Mutant) -> Fate | None:
        """What became of a mutant, if that still holds."""
        entry = self._known.get(mutant.key)
        if entry is None or entry.source != digest(self._root, f"{SOURCE}/{mutant.file}"):
            return None
        same_tests = entry.tests == digest(self._root, *PLANS[mutant.file].files)
        return entry.fate if same_tests or entry.fate != "alive" else None

    def add(self, mutant: Mutant, fate: str) -> None:
        """Write down what became of a mutant."""
        if self._path is None:
            return
        names = ("file", "function", "operator", "line", "was", "now")
        told: dict[str, Any] = {name: getattr(mutant, name) for name in names}
        told |= {"fate": fate, "source": digest(self._root, f"{SOURCE}/{mutant.file}")}
        told |= {"tests": digest(self._root, *PLANS[mutant.file].files)}
        self._path.parent.mkdir(parents=True, exist_ok=True)
        with self._path.open("a") as out:
            out.write(json.dumps(told) + "\n")


@functools.cache
def digest(root: Path, *files: str) -> str:
    """A hash of the text of files."""
    sha = hashlib.sha256()
    for file in files:
        sha.update((root / file).read_bytes())
    return sha.hexdigest()[:16]
