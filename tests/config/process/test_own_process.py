from __future__ import annotations

import subprocess
import sys


def test_loaded_objects_are_excluded_from_garbage_collection() -> None:
    code = (
        "import gc\n"
        "from config.process.own_process import keep_from_collections\n"
        "kept = [[number] for number in range(10_000)]\n"
        "keep_from_collections()\n"
        "assert gc.get_freeze_count() > 10_000\n"
        "assert len(gc.get_objects()) < 1000\n"
        "new = []\n"
        "new.append(new)\n"
        "del new\n"
        "assert gc.collect() >= 1\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
