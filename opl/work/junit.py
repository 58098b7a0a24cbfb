"""The rows of a batch as JUnit XML, which build servers show."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence

from opl.run.batch import BatchRow

REFUSED = ("no_path", "unsafe")  # a result; all else is an error


def junit(rows: Sequence[BatchRow]) -> str:
    """Return a test suite with a case for each job.

    A job without a path, or not proven safe, is a failure; a bad input or a crash is an error. A
    job that was answered from the store is skipped if it has a program.
    """
    suite = ET.Element("testsuite", name="opl batch", tests=str(len(rows)))
    for row in rows:
        seconds = 0.0 if row.result is None or row.unchanged else row.result.seconds["total"]
        values = " ".join(f"{key}={value}" for key, value in row.variant.items())
        name = " ".join([str(row.job), values]).strip()
        case = ET.SubElement(suite, "testcase", classname="opl", name=name, time=f"{seconds:.3f}")
        if row.exit_status != 0:
            kind = "failure" if row.status in REFUSED else "error"
            first = row.message.partition("\n")[0]
            ET.SubElement(case, kind, message=_plain(first), type=row.status).text = _plain(
                row.message
            )
        elif row.unchanged:
            ET.SubElement(case, "skipped", message="unchanged")
    for kind in ("failure", "error", "skipped"):
        attribute = kind if kind == "skipped" else f"{kind}s"
        suite.set(attribute, str(len(suite.findall(f"testcase/{kind}"))))
    ET.indent(suite)
    return (
        '<?xml version="1.0" encoding="utf-8"?>\n' + ET.tostring(suite, encoding="unicode") + "\n"
    )


def _plain(text: str) -> str:
    """Return a text without the characters that XML does not know."""
    return "".join(sign if sign.isprintable() or sign in "\n\t" else "?" for sign in text)
