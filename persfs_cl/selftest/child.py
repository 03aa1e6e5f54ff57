"""``python -m persfs_cl.selftest.child``: the cases of one device, and a JSON line for a parent for all that happens.

Whatever the driver prints goes to standard error: the lines have the pipe that was standard output to themselves.
"""

from __future__ import annotations

import argparse
import faulthandler
import json
import math
import os
import time
import warnings
from dataclasses import asdict
from typing import Any, TextIO

from persfs_cl._cl.device import devices
from persfs_cl._cl.selftest import facts
from persfs_cl.errors import KernelBuildError, PersfsError
from persfs_cl.selftest.cases import cases
from persfs_cl.selftest.checks import Checks


def _main() -> None:
    lines = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    # A crash says where it was.
    faulthandler.enable()
    # What compilers grumble is shown with a failure, and is none.
    warnings.simplefilter("ignore")
    parser = argparse.ArgumentParser()
    parser.add_argument("device", type=int, help="number in the list of devices")
    parser.add_argument("--first", type=int, default=0, help="number of the case to begin with")
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--seconds", type=float, default=math.inf, help="after which no case is begun")
    given = parser.parse_args()
    _check(lines, given.device, given.first, time.monotonic() + given.seconds, quick=given.quick)


def _check(lines: TextIO, number: int, first: int, deadline: float, *, quick: bool) -> None:
    def say(event: str, **more: Any) -> None:
        print(json.dumps({"event": event, **more}, default=float), file=lines, flush=True)

    device = devices()[number]
    say("device", name=device.name, facts=facts(device))
    checks = Checks(device)
    for place, case in enumerate(cases(quick=quick)):
        if place < first:
            continue
        if case.precision == "float64" and not device.has_float64:
            say("end", case=place, status="not there", message="the device has no double precision")
            continue
        if time.monotonic() > deadline:
            say("end", case=place, status="skipped", message="the time limit was reached before")
            continue
        say("begin", case=place)
        checks.compiled = lambda place=place: say("compiled", case=place)  # type: ignore[misc]
        began = time.perf_counter()
        try:
            outcome = checks.run(case)
        except Exception as error:  # noqa: BLE001 - whatever it is, it is what the test has found
            message = str(error) if isinstance(error, PersfsError) else f"{type(error).__name__}: {error}"
            say("end", case=place, status="failed", message=message, seconds=time.perf_counter() - began)
            if not isinstance(error, KernelBuildError):
                # After a fault some drivers fail at everything: what is left is for a new process.
                return
            continue
        result = asdict(outcome)
        status = "ok" if result.pop("ok") else "failed"
        say("end", case=place, status=status, seconds=time.perf_counter() - began, **result)
    say("done")


if __name__ == "__main__":
    _main()
