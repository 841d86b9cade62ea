"""Rows as Parquet and lines as JSON, written and read back without pandas."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np


def write_rows(path: Path, columns: Mapping[str, np.ndarray], metadata: Mapping[str, str] | None = None) -> None:
    """One Parquet file; a column [n, k] becomes lists of fixed length k."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pa.table({name: _column(values) for name, values in columns.items()})
    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(table.replace_schema_metadata(metadata), path)


def write_records(path: Path, records: Sequence[Mapping[str, Any]], metadata: Mapping[str, str] | None = None) -> None:
    """One Parquet file of records, their types as pyarrow infers them."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(pa.Table.from_pylist(list(records)).replace_schema_metadata(metadata), path)


def read_rows(path: Path, names: Iterable[str]) -> dict[str, np.ndarray]:
    """Columns of a file that `write_rows` wrote."""
    import pyarrow.parquet as pq

    table = pq.read_table(path, columns=list(names))
    return {name: _values(table[name].combine_chunks()) for name in table.column_names}


def write_json(path: Path, value: object) -> None:
    """A JSON file, indented."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(value, indent=2) + "\n")


def write_lines(path: Path, values: Iterable[object]) -> None:
    """A file of JSON lines."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("".join(json.dumps(value) + "\n" for value in values))


def plain(statistics: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """Arrays as the lists that JSON knows."""
    return {name: value.tolist() for name, value in statistics.items()}


def _column(values: np.ndarray) -> Any:
    import pyarrow as pa

    values = np.ascontiguousarray(values)
    if values.ndim == 1:
        return pa.array(values)
    return pa.FixedSizeListArray.from_arrays(pa.array(values.ravel()), values.shape[1])


def _values(column: Any) -> np.ndarray:
    import pyarrow as pa

    if pa.types.is_fixed_size_list(column.type):
        return column.flatten().to_numpy(zero_copy_only=False).reshape(-1, column.type.list_size)
    return column.to_numpy(zero_copy_only=False)
