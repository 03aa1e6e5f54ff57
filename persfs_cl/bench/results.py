"""What was measured, as plain records, and the files that hold them."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

from persfs_cl.bench.timing import Spread
from persfs_cl.io.files import FilePath, atomic_path


@dataclass(frozen=True)
class Record:
    """One quantity of one workload, measured several times.

    Attributes
    ----------
    experiment, workload, quantity, unit : str
    size : int
        Pixels along an edge of the square image; 0 where no image is involved.
    images : int
        Images that share launches.
    precision : str
    median, lowest, highest : float or None
        Of the repeats; None when the workload was skipped, and `detail` says why.
    repeats : int
    by_device : float or None
        The median by the device's own clock (OpenCL events), in the same unit.
    factor : float or None
        How many times the rate of the plain C sweep this is: median over the rounds in which both were measured.
    iteration : int or None
        After which iteration the quantity was found, where that matters.
    detail : str
    """

    experiment: str
    workload: str
    quantity: str
    unit: str
    size: int
    images: int
    precision: str
    median: float | None = None
    lowest: float | None = None
    highest: float | None = None
    repeats: int = 0
    by_device: float | None = None
    factor: float | None = None
    iteration: int | None = None
    detail: str = ""

    @classmethod
    def of(cls, values: Sequence[float], **others: Any) -> Record:
        """The record of at least one measurement; `others` are the remaining attributes."""
        spread = Spread.of(values)
        return cls(median=spread.median, lowest=spread.lowest, highest=spread.highest, repeats=spread.repeats, **others)


def write_json(path: FilePath, header: Mapping[str, Any], records: Sequence[Record]) -> None:
    """Write the environment and all records.

    Raises
    ------
    InputError
        When the file cannot be written.
    """
    content = {"header": dict(header), "records": [asdict(record) for record in records]}
    text = json.dumps(content, indent=1, allow_nan=False, ensure_ascii=False)
    with atomic_path(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")


def write_csv(path: FilePath, records: Sequence[Record]) -> None:
    """Write the records as a table, one a line; a cell is empty where a record holds None.

    Raises
    ------
    InputError
        When the file cannot be written.
    """
    names = [field.name for field in fields(Record)]
    with atomic_path(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, names)
        table.writeheader()
        table.writerows(asdict(record) for record in records)
