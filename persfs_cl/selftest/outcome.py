"""What came of a case."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class Outcome:
    """What came of a case.

    Attributes
    ----------
    ok : bool
    difference, tolerance : float or None
        The largest difference from the reference, and how large it may be.
    compile_seconds : float
        Until the kernels had run for the first time, less what another such run takes.
    kernel, reason : str
        Which kernel swept, in words, and why that one.
    rate : float or None
    unit : str
        Of a measurement: Mc/s, million cell updates a second, or GB/s, read and written.
    message : str
        What is wrong, or what was not compared.
    """

    ok: bool = True
    difference: float | None = None
    tolerance: float | None = None
    compile_seconds: float = 0.0
    kernel: str = ""
    reason: str = ""
    rate: float | None = None
    unit: str = ""
    message: str = ""

    def compare(self, what: str, difference: float, tolerance: float) -> None:
        """Note a difference; written so that NaN is none that may be."""
        if self.difference is None or not difference <= self.difference:
            self.difference, self.tolerance = difference, tolerance
        if not difference <= tolerance:
            self.fail(f"{what} differ by {difference:.2g}, and may by {tolerance:.0e}")

    def fail(self, message: str) -> None:
        """Note that something is wrong."""
        self.ok = False
        self.message = f"{self.message}; {message}" if self.message else message
