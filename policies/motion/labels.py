"""What is known of a motion file beside its curves: from an index in the folder, else from its name."""

from __future__ import annotations

import csv
import hashlib
import re
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

from policies.motion.clip import Split

VALIDATION_SHARE = 5
"""One subject in so many goes to validation where no index says otherwise."""
_WORDS = {
    "run": ("run", "jog", "sprint"),
    "jump": ("jump", "leap", "skip", "hop"),
    "walk": ("walk", "step", "march"),
    "dance": ("dance", "salsa"),
    "fight": ("kick", "punch", "jab", "hook", "karate", "box"),
}


@dataclass(frozen=True)
class Labels:
    """Name, person, kind and split of one clip."""

    name: str
    subject: str
    category: str
    split: Split


def sources(folder: Path) -> list[Path]:
    """Motion files below a folder, sorted: .bvh, .csv, and both with .gz; index files are left out."""
    names = (path for path in sorted(folder.rglob("*")) if path.is_file() and not path.name.startswith("."))
    return [path for path in names if kind(path) is not None and not _is_index(path)]


def kind(path: Path) -> str | None:
    """`bvh` or `csv`; None for any other file."""
    suffix = Path(path.stem).suffix if path.suffix == ".gz" else path.suffix
    return suffix[1:].lower() if suffix.lower() in (".bvh", ".csv") else None


def read_index(folder: Path) -> dict[Path, Labels]:
    """Labels by file from every index in the folder: a CSV with the columns `file` and `split`, and, if there are,
    `clip_id`, `subject` or `performer`, `category`. A split that is neither train nor val is decided by subject."""
    found: dict[Path, Labels] = {}
    for path in sorted(folder.glob("*.csv")):
        if _is_index(path):
            with _open(path) as file:
                found |= {(folder / row["file"]).resolve(): _indexed(row) for row in _rows(file) if row["file"]}
    return found


def guess(path: Path) -> Labels:
    """Labels from a file name: CMU's 07_12 is subject cmu07, otherwise the subject is what stands before the first separator."""
    name = path.name.split(".")[0]
    cmu = re.match(r"(?:cmu_)?(\d+)_\d+", name)
    subject = f"cmu{int(cmu[1]):02d}" if cmu else re.split(r"[_\-\s]", name)[0]
    spoken = name.lower()
    category = next((label for label, words in _WORDS.items() if any(word in spoken for word in words)), "other")
    return Labels(name, subject, category, _by_subject(subject))


def _indexed(row: dict[str, str]) -> Labels:
    name = row.get("clip_id") or Path(row["file"]).name.split(".")[0]
    subject = row.get("subject") or row.get("performer") or guess(Path(row["file"])).subject
    split: Split = "val" if row["split"] == "val" else "train" if row["split"] == "train" else _by_subject(subject)
    return Labels(name, subject, row.get("category") or "other", split)


def _by_subject(subject: str) -> Split:
    return "val" if int(hashlib.sha256(subject.encode()).hexdigest()[:8], 16) % VALIDATION_SHARE == 0 else "train"


def _is_index(path: Path) -> bool:
    if path.suffix != ".csv":
        return False
    with _open(path) as file, suppress(csv.Error):
        return {"file", "split"} <= set(_rows(file).fieldnames or ())
    return False


def _open(path: Path) -> TextIO:
    return path.open(newline="", encoding="utf-8-sig", errors="replace")  # spreadsheets begin a file with a mark


def _rows(file: TextIO) -> csv.DictReader:
    """Rows of an index; blanks before a column or after its name do not count, what a row lacks is empty."""
    reader = csv.DictReader(file, restval="", skipinitialspace=True)
    reader.fieldnames = [column.strip() for column in reader.fieldnames or ()]
    return reader
