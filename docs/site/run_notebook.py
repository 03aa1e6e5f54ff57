"""Run a notebook of the handbook: ``python docs/site/run_notebook.py FILE [COPY]``.

What it showed before is replaced, or the new one goes to the copy. Nothing of the machine stays in the file.
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path

import nbformat
from nbclient import NotebookClient
from traitlets.config import Config


def run(source: Path, target: Path) -> None:
    """Run a notebook in an empty folder, and write it with what it shows."""
    notebook = nbformat.read(source, as_version=4)
    with tempfile.TemporaryDirectory() as folder:
        os.environ.update(IPYTHONDIR=folder, JUPYTER_RUNTIME_DIR=f"{folder}/runtime", MPLCONFIGDIR=folder)
        work = Path(folder) / "work"
        work.mkdir()
        NotebookClient(
            notebook,
            kernel_name="python3",
            # By files, not by ports, which another program may take before the kernel does.
            config=Config({"AsyncKernelManager": {"transport": "ipc", "ip": f"{folder}/kernel"}}),
            timeout=600,
            startup_timeout=600,
            record_timing=False,
            store_widget_state=False,
            resources={"metadata": {"path": str(work)}},
        ).execute()
    notebook.metadata = {"kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}}
    nbformat.write(notebook, target)


if __name__ == "__main__":
    run(Path(sys.argv[1]), Path(sys.argv[-1]))
