"""Records as the tables of the pages that publish them, by the names of their markers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from persfs_cl.bench.accuracy_tables import ACCURACY_TABLES
from persfs_cl.bench.cells import Records, Tables
from persfs_cl.bench.rates import PLAIN_C
from persfs_cl.bench.speed_tables import SPEED_TABLES
from persfs_cl.environment import summary
from persfs_cl.page import ENVIRONMENT

_TABLES: Tables = {**SPEED_TABLES, **ACCURACY_TABLES}


def contents(header: Mapping[str, Any], records: Records) -> dict[str, str]:
    """What belongs between the markers of a page: the environment, and the tables of the experiments that were run.

    Parameters
    ----------
    header : mapping
        As :func:`persfs_cl.environment.environment` has it.
    records : sequence of Record
        Each experiment's own all together, in the order in which they were found.
    """
    found = {ENVIRONMENT: _environment(header, records)}
    for name, (experiment, made) in _TABLES.items():
        if own := [record for record in records if record.experiment == experiment]:
            found[name] = made(own)
    return found


def markers(experiments: Iterable[str]) -> list[str]:
    """Names of the tables that come of some experiments."""
    wanted = set(experiments)
    return [name for name, (experiment, _) in _TABLES.items() if experiment in wanted]


def _environment(header: Mapping[str, Any], records: Records) -> str:
    parts = [summary(header).replace("\n", "; ")]
    parts += [record.detail for record in records if record.workload == PLAIN_C and record.median is not None][:1]
    if header["load_average"] is not None:
        parts.append(f"load average at the start {header['load_average']:.1f}")
    return "; ".join(parts)
