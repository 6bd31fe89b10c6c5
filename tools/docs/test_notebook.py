"""The notebook of docs/ runs from its first cell to its last."""

import sys

import pytest


def test_the_notebook_runs(root):
    nbclient = pytest.importorskip("nbclient", reason="nbclient is not installed")
    nbformat = pytest.importorskip("nbformat")
    pytest.importorskip("ipykernel", reason="ipykernel is not installed")
    notebook = nbformat.read(root / "docs/notebooks/diagnose.ipynb", as_version=4)
    # What GitHub shows of it is what it says.
    assert "poses are off" in str([cell.get("outputs") for cell in notebook.cells])
    client = nbclient.NotebookClient(
        notebook, timeout=300, resources={"metadata": {"path": str(root)}}
    )
    # This Python's kernel, whatever else is installed for the user.
    client.create_kernel_manager()
    client.km.kernel_cmd = [sys.executable, "-m", "ipykernel_launcher", "-f"]
    client.km.kernel_cmd += ["{connection_file}"]
    client.execute()
    (printed,) = (
        output.text
        for cell in notebook.cells
        for output in cell.get("outputs", [])
        if output.output_type == "stream" and "VERDICT" in output.text
    )
    assert "poses are off" in printed
