#!/usr/bin/env python3
"""CHANGELOG.md (Keep a Changelog) as a Debian changelog, one entry a version.

    changelog.py CHANGELOG.md OUT

A version that is not released yet bears the time of $SOURCE_DATE_EPOCH, else that of the file.
"""
import datetime
import os
import pathlib
import re
import sys
import textwrap

CONTACT = "stereotrack maintainers <stereotrack@packages.invalid>"


def bullets(text):
    """The points of all sections, each on one line, without the form of Markdown."""
    for part in re.split(r"^(?=- )", text, flags=re.M)[1:]:
        point = re.split(r"\n\s*\n|\n#", part[2:])[0]
        point = re.sub(r"\[([^\]]+)\]\([^)]+\)", r"\1", point).replace("`", "")
        yield " ".join(point.split())


def main():
    path, out = map(pathlib.Path, sys.argv[1:3])
    versions = re.findall(r"^## \[(\d[^\]]*)\] - (\S+)\n(.*?)(?=^## |\Z)", path.read_text(), re.M | re.S)
    if not versions:
        sys.exit(f"{path}: no ## [VERSION] - DATE")
    entries = []
    for version, when, text in versions:
        if when == "unreleased":
            seconds = int(os.environ.get("SOURCE_DATE_EPOCH") or path.stat().st_mtime)
            date = datetime.datetime.fromtimestamp(seconds, datetime.timezone.utc)
        else:
            date = datetime.datetime.fromisoformat(when).replace(tzinfo=datetime.timezone.utc)
        points = [textwrap.fill(point, 76, initial_indent="  * ", subsequent_indent="    ", break_long_words=False,
                                break_on_hyphens=False) for point in bullets(text)]
        entries.append(f"stereotrack ({version}) unstable; urgency=medium\n\n" + "\n".join(points) +
                       f"\n\n -- {CONTACT}  {date:%a, %d %b %Y %H:%M:%S %z}\n")
    out.write_text("\n".join(entries))


if __name__ == "__main__":
    main()
