"""The experiments, in the order in which they run."""

from __future__ import annotations

from collections.abc import Callable

from persfs_cl.paper import sensitivity, statue, vase
from persfs_cl.paper.plan import Plan
from persfs_cl.paper.report import Findings

EXPERIMENTS: dict[str, Callable[[Plan], Findings]] = {
    "the vase, Table 1 and Figure 2": vase.experiment,
    "the statue, Table 2 and Figure 3": statue.experiment,
    "what the paper leaves open": sensitivity.experiment,
}
"""By what is said while they run."""
