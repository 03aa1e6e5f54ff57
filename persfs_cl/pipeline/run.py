"""One run of a batch: which photographs are to be done, and what has become of each."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from persfs_cl.errors import InputError, PersfsError, PersfsWarning
from persfs_cl.pipeline.claim import claimed
from persfs_cl.pipeline.listing import Input, Listing
from persfs_cl.pipeline.manifest import Known, Record, as_entry, latest, now, package_version
from persfs_cl.pipeline.plan import Plan, is_the_same
from persfs_cl.pipeline.shards import Shard, is_in
from persfs_cl.pipeline.station import Task
from persfs_cl.pipeline.store import FolderStore, Journal, Results, Store
from persfs_cl.pipeline.workforce import Workforce
from persfs_cl.surface.solution import Solution

Again = Literal["changed", "all", "none", "failed"]
"""Which photos are done again that were done before."""


@dataclass(frozen=True)
class BatchResult:
    """What has become of one photo of a batch.

    Attributes
    ----------
    path : Path
        Its file.
    name : str
        Of its results, below the output.
    record : Record
        What the manifest says of it.
    solution : Solution or None
        Where there is no output, and no error.
    error : PersfsError or None
        Why there is no surface.
    warnings : tuple of PersfsWarning
        What was warned of while there came to be one.

    Examples
    --------
    >>> import persfs_cl as ps
    >>> for result in ps.batch("no such folder"):
    ...     print(result.path, result.solution, result.record.status, type(result.error).__name__)
    no such folder None failed InputError
    """

    path: Path
    name: str
    record: Record
    solution: Solution | None = None
    error: PersfsError | None = None
    warnings: tuple[PersfsWarning, ...] = ()


class Batch:
    """Photos to be done, or what is left of them.

    Parameters
    ----------
    listing : Listing
    plan : Plan
    store : Store or None
        None sends the solutions instead.
    again : {"changed", "all", "none", "failed"}
        Done again are photos that failed, and those whose files or parameters have changed; all; none, whatever was
        made and however; or those alone that failed, and no others.
    shard : (int, int) or None
        Number, from 1, and count of the share of the photos to be done.

    Attributes
    ----------
    total : int
        Photos of this share.
    skipped : int
        Photos found done so far.
    lacking : int
        Those of them that are done as they are wanted now, but for a file that could not be made.
    """

    def __init__(
        self,
        listing: Listing,
        plan: Plan,
        store: Store | None,
        *,
        again: Again = "changed",
        shard: Shard | None = None,
    ) -> None:
        self._plan, self._store, self._again, self._shard = plan, store, again, shard
        self._inputs = [one for one in listing.inputs if is_in(shard, one.name)]
        self._problems = [one for one in listing.problems if is_in(shard, one[0])]
        self._roots = listing.roots
        self.total, self.skipped, self.lacking = len(self._inputs) + len(self._problems), 0, 0
        self._given: dict[int, Input] = {}
        self._refused: deque[tuple[BatchResult, bool]] = deque()
        """With whether the manifest shall know of it."""

    def results(
        self,
        workforce: Callable[[Sequence[int]], Workforce],
        interrupted: Callable[[], bool] = lambda: False,
    ) -> Iterator[BatchResult]:
        """Do what is left, and say of each photo what has become of it.

        Parameters
        ----------
        workforce : callable
            Gives who does the tasks; called with the file descriptors that processes are to hold.
        interrupted : callable
            Whether an end is asked for.

        Raises
        ------
        InputError
            When another run is at work on the output, or it cannot be written to.
        DeviceError
            When no device is left.
        """
        with ExitStack() as open_things:
            held: Sequence[int] = ()
            if isinstance(self._store, FolderStore):
                held = open_things.enter_context(claimed(self._store.root, self._shard))
            journal = None
            if self._store is not None:
                # Now, for there may be nobody to do anything, and then, for processes may have been ended.
                self._store.clean()
                open_things.callback(self._store.clean)
                journal = self._store.journal()
                open_things.callback(journal.close)
            tasks = self._tasks(journal, interrupted)
            # Without a task there is nobody to call.
            first = next(tasks, None)
            yield from self._noted(journal)
            if first is None:
                return
            with closing(workforce(held).outcomes(_chained(first, tasks), interrupted)) as outcomes:
                for outcome in outcomes:
                    yield from self._noted(journal)
                    if outcome.end == "dropped":
                        continue
                    if journal is not None:
                        journal.add(outcome.record)
                    yield BatchResult(
                        self._given.pop(outcome.number).path,
                        outcome.record.name,
                        outcome.record,
                        outcome.solution,
                        outcome.error,
                        tuple(map(PersfsWarning, outcome.said or outcome.record.warnings)),
                    )
            yield from self._noted(journal)

    def pending(self) -> Iterator[Task | BatchResult]:
        """What would be done, and the photos that nobody would be called for. Writes nothing."""
        for task in self._tasks(None, lambda: False):
            yield from self._noted(None)
            yield task
        yield from self._noted(None)

    def _noted(self, journal: Journal | None) -> Iterator[BatchResult]:
        """The photos that nobody need be called for."""
        while self._refused:
            result, noted = self._refused.popleft()
            if noted and journal is not None:
                journal.add(result.record)
            yield result

    def _tasks(self, journal: Journal | None, interrupted: Callable[[], bool]) -> Iterator[Task]:
        for place, error in self._problems:
            # No photo, such as a path with a slip in it: it would be among the failures for ever.
            self._refuse(Path(place), place, error, noted=False)
        known = {} if self._store is None else latest(self._store.manifests())
        there = None if self._store is None else self._store.results()
        # Photos that end processes or devices must not come before others in every run.
        failed: list[int] = []
        for number, one in enumerate(self._inputs):
            if interrupted():
                return
            before = known.get(one.name)
            if before is not None and before.status == "failed" and self._again != "none":
                failed.append(number)
            elif (task := self._task(number, before, there, journal)) is not None:
                yield task
        for number in failed:
            if interrupted():
                return
            if (task := self._task(number, known[self._inputs[number].name], there, journal)) is not None:
                yield task

    def _task(self, number: int, before: Known | None, there: Results | None, journal: Journal | None) -> Task | None:
        """What is to be done with a photo, if it is."""
        one = self._inputs[number]
        if before is not None and before.status == "done" and there is not None and one.name not in there:
            before = None  # somebody removed it
        if (self._again == "none" and before is not None and before.status == "done") or (
            self._again == "failed" and (before is None or before.status == "done")
        ):
            self.skipped += 1
            return None
        try:
            if before is not None and self._again != "all":
                _require_same_photo(one, before)
            job = self._plan.job(one, self._roots)
        except PersfsError as error:
            # What another photo has come to stays noted.
            self._refuse(one.path, one.name, error, noted=before is None or before.status == "failed")
            return None
        task = Task(number, one.name, job, self._plan.parameter_hash(job))
        if self._again != "all" and (
            self._is_as_wanted(task, before) or self._is_adopted(task, before, there, journal)
        ):
            self.skipped += 1
            return None
        self._given[number] = one
        return task

    def _is_as_wanted(self, task: Task, before: Known | None) -> bool:
        if before is None or before.status != "done":
            return False
        if self._again != "none" and not is_the_same(task.job, task.parameter_hash, before):
            return False
        self.lacking += bool(self._plan.saving.lacking(before.files))
        return True

    def _is_adopted(self, task: Task, before: Known | None, there: Results | None, journal: Journal | None) -> bool:
        """Whether there is a result that its run could not note any more: it is noted now."""
        found = None if there is None else there.record(task.name)
        if found is None or (before is not None and found.finished <= before.finished):
            return False
        if journal is None or not self._is_as_wanted(task, Known.of(found)):
            return False
        journal.add(found)
        return True

    def _refuse(self, path: Path, name: str, error: PersfsError, *, noted: bool = True) -> None:
        record = Record(
            name=name,
            path=str(path),
            status="failed",
            error=as_entry(error, self._plan.spelling),
            version=package_version(),
            finished=now(),
        )
        self._refused.append((BatchResult(path, name, record, error=error), noted))


def _require_same_photo(one: Input, before: Known) -> None:
    """Refuse to put results in the place of another photo's.

    Raises
    ------
    InputError
        When the results of this name are of another file, which is still there.
    """
    earlier = Path(before.path)
    if before.status == "done" and earlier != one.path:
        with suppress(OSError):
            if not earlier.samefile(one.path):
                raise InputError(
                    f"{one.path} would have the results of {earlier}, {one.name}: choose another output, or do all "
                    "again, whatever was done before."
                )


def _chained(first: Task, rest: Iterator[Task]) -> Iterator[Task]:
    yield first
    yield from rest
