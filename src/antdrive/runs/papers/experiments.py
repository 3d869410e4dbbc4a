"""Experiments of all papers, by paper."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from antdrive.runs.papers.experiment import Experiment
from antdrive.runs.papers.han2007 import han2007
from antdrive.runs.papers.hasan import hasan
from antdrive.runs.papers.ibraheem2016 import ibraheem2016
from antdrive.runs.papers.lee2008 import lee2008
from antdrive.runs.papers.suganthi2019 import suganthi2019

#: Functions that list a paper's experiments, by its short name.
PAPERS: Mapping[str, Callable[[], list[Experiment]]] = MappingProxyType(
    {f.__name__: f for f in (han2007, suganthi2019, ibraheem2016, lee2008, hasan)}
)
