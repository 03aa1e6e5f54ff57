import threading
import warnings
from contextlib import contextmanager
from dataclasses import dataclass


@dataclass
class Told:
    message: str
    place: int | None = None


_local = threading.local()


@contextmanager
def hearing():
    said = []
    old = getattr(_local, "said", None)
    _local.said = said
    try:
        yield said
    finally:
        _local.said = old


@contextmanager
def concerning(place):
    yield


def listen():
    warnings.simplefilter("always")

    def show(message, *a, **k):
        said = getattr(_local, "said", None)
        if said is not None:
            said.append(Told(str(message)))

    warnings.showwarning = show
