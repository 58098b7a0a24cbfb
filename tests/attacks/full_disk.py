"""Deliver to a disk of few kilobytes; run by test_delivery.py in a mount name space of its own."""

import subprocess
import sys
from pathlib import Path

from opl.errors import InputError
from opl.files.claiming import claimed
from opl.files.writing import HIDDEN

OLD = {"V.JBI": "old", "result.json": "old"}
NEW = {"V.JBI": "new" * 10_000, "V.csv": "new" * 20_000, "result.json": "new" * 3_000}

disk = Path(sys.argv[1]) / "disk"
disk.mkdir()
refused = done = 0
for kilobytes in range(40, 240, 12):
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={kilobytes}k", "tmpfs", disk], check=True)
    with claimed(disk / "out") as claim:
        claim.switch(OLD)
    try:
        with claimed(disk / "out") as claim:
            claim.switch(NEW)
        done += 1
        wanted = NEW
    except InputError as error:
        assert "cannot be written to: No space left" in str(error), error
        refused += 1
        wanted = OLD
    assert {path.name: path.read_text() for path in (disk / "out").iterdir()} == wanted, kilobytes
    assert not [path for path in disk.rglob("*") if path.name.startswith(HIDDEN)], kilobytes
    subprocess.run(["umount", disk], check=True)
print(refused, done)
