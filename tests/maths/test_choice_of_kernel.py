"""Which kernel is taken, and what is said where it is not the one that was meant."""

import sys
from types import SimpleNamespace

import pytest
from called import call

from hfsim.errors import KernelError
from hfsim.maths import kernel

NAME = "hfsim.maths._replay"
THERE = SimpleNamespace(SOURCE=0)


def chosen(monkeypatch, wanted, module):
    monkeypatch.setenv("HFSIM_KERNEL", wanted)
    monkeypatch.setitem(sys.modules, NAME, module)
    return kernel.chosen()


@pytest.mark.parametrize("wanted", ["", "native"])
def test_a_kernel_that_is_there_is_taken(wanted, monkeypatch):
    assert chosen(monkeypatch, wanted, THERE) == (THERE, "")


@pytest.mark.parametrize("module", [THERE, None])
def test_numpy_is_taken_without_a_word_if_wanted(module, monkeypatch):
    assert chosen(monkeypatch, "numpy", module) == (None, "")


def test_a_kernel_that_is_not_there_is_done_without(monkeypatch):
    found, why = chosen(monkeypatch, "", None)
    assert found is None and "not built" in why
    with pytest.raises(KernelError, match=r"HFSIM_KERNEL=native: .*not built"):
        chosen(monkeypatch, "native", None)


def test_a_kernel_of_another_source_is_not_taken(monkeypatch, tmp_path):
    """An editable install whose source was changed: operations would be read with another meaning."""
    (tmp_path / "_replay.c").write_bytes(b"56789")
    (tmp_path / "_record.c").write_bytes(b"1234")
    monkeypatch.setattr(kernel, "SOURCES", tmp_path)
    own = SimpleNamespace(SOURCE=0xCBF43926 & 0x7FFFFFFF)
    assert chosen(monkeypatch, "", own) == (own, "")
    found, why = chosen(monkeypatch, "", SimpleNamespace(SOURCE=own.SOURCE + 1))
    assert found is None and "other sources" in why


@pytest.mark.parametrize("wanted", ["fast", "NumPy", "1"])
def test_what_is_no_kernel_is_an_error(wanted, monkeypatch):
    with pytest.raises(KernelError, match=rf"HFSIM_KERNEL={wanted}: .*native or numpy") as caught:
        chosen(monkeypatch, wanted, THERE)
    assert caught.value.exit_code == 2


def test_the_version_tells_the_kernel(monkeypatch):
    said = call("--version").output
    assert f", kernel {kernel.KERNEL}" in said
    monkeypatch.setattr(kernel, "MISSING", "it is on holiday")
    assert "(it is on holiday)\n" in call("--version").output
