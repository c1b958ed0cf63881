"""Kernels compiled with an older version of a called function are not reused."""

from __future__ import annotations

from pathlib import Path

from tests.builders.compiled_kernels import forget_stale_kernels


def test_a_changed_kernel_discards_all_compiled_code(tmp_path: Path) -> None:
    callee, caller = tmp_path / "dynamics/callee.py", tmp_path / "compensation/caller.py"
    for source in (callee, caller):
        source.parent.mkdir()
        source.write_text("@kernel\ndef f(x):\n    return x\n")
    (tmp_path / "dynamics/other.py").write_text("x = 1\n")
    compiled = caller.parent / "__pycache__/caller.f-1.py311.nbi"
    compiled.parent.mkdir()
    assert forget_stale_kernels(tmp_path)

    compiled.touch()
    assert not forget_stale_kernels(tmp_path)
    (tmp_path / "dynamics/other.py").write_text("x = 2\n")
    assert not forget_stale_kernels(tmp_path)
    assert compiled.exists()

    callee.write_text("@kernel\ndef f(x):\n    return 2 * x\n")
    assert forget_stale_kernels(tmp_path)
    assert not compiled.exists()
