"""Decoders talk in many ways; what they say becomes one error or one warning."""

from __future__ import annotations

import logging
import os
import sys
import threading
import warnings
from typing import NoReturn

import pyopencl as cl
import pytest

import persfs_cl as ps
from persfs_cl._cl.program import program
from persfs_cl.errors import CameraError, InputError
from persfs_cl.io.remarks import decoding, heard_on_standard_error


def test_log_lines_and_warnings_become_one_warning(capfd: pytest.CaptureFixture[str]) -> None:
    def decode() -> None:
        with decoding("a.tif"):
            logging.getLogger("tifffile").warning("the first\n line.")
            warnings.warn("another", RuntimeWarning, stacklevel=1)
            warnings.warn("another", RuntimeWarning, stacklevel=1)

    with pytest.warns(
        UserWarning, match=r"a\.tif was read, but is damaged or odd \(the first line, and 1 more\): look"
    ) as said:
        decode()
    assert len(said) == 1
    assert capfd.readouterr() == ("", "")


def test_other_threads_keep_their_log(caplog: pytest.LogCaptureFixture) -> None:
    with decoding("a.tif"):
        other = threading.Thread(target=lambda: logging.getLogger("tifffile").warning("of another file"))
        other.start()
        other.join()
    assert [record.getMessage() for record in caplog.records] == ["of another file"]


def test_a_compilation_in_another_thread_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each would bring back the filters of warnings that the other had set for a while."""
    begun = threading.Event()

    def compiled(*_given: object) -> NoReturn:
        begun.set()
        raise cl.LogicError("enough")

    (device, *_) = ps.devices()
    assert device.context
    monkeypatch.setattr(cl, "Program", compiled)
    monkeypatch.setattr("persfs_cl._cl.program._ATTEMPTS", 1)
    filters = list(warnings.filters)
    failures: list[Exception] = []

    def build() -> None:
        try:
            program(device, ["render"], "float32", {"LANES": 16})
        except ps.KernelBuildError as error:
            failures.append(error)

    with decoding("a.tif"):
        other = threading.Thread(target=build)
        other.start()
        assert not begun.wait(0.2)
    other.join()
    assert (begun.is_set(), len(failures)) == (True, 1)
    assert warnings.filters == filters


def test_what_is_meant_for_developers_stays_what_it_is() -> None:
    with pytest.warns(DeprecationWarning, match="will go"), decoding("a.tif"):
        warnings.warn("will go", DeprecationWarning, stacklevel=1)


@pytest.mark.parametrize("error", [ValueError("no\n good."), KeyError("x"), RecursionError(), SystemError("odd")])
def test_whatever_a_decoder_raises_is_an_input_error(error: Exception) -> None:
    def decode() -> None:
        with decoding("a.tif"):
            logging.getLogger("tifffile").warning("said before the error")
            raise error

    with pytest.raises(InputError, match=r"a\.tif is broken or not supported \(.+\): save or copy it again\."):
        decode()


@pytest.mark.parametrize("error", [InputError("mine"), CameraError("mine"), KeyboardInterrupt()])
def test_errors_on_purpose_pass(error: BaseException) -> None:
    with pytest.raises(type(error)), decoding("a.tif"):
        raise error


def test_lines_of_decoders_on_standard_error_are_remarks_and_others_stay(capfd: pytest.CaptureFixture[str]) -> None:
    def decode() -> None:
        with decoding("a.dng"), heard_on_standard_error():
            os.write(2, b"a.dng: data corrupted at 17\nof another thread\n")
            sys.stderr.write("PNG warning: too long\nof Python\n")

    with pytest.warns(
        UserWarning, match=r"a\.dng was read, but is damaged or odd \(PNG warning: too long, and 1 more\)"
    ):
        decode()
    assert capfd.readouterr() == ("", "of Python\nof another thread\n")
