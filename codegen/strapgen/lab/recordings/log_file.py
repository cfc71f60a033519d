"""A file of recorded tables, whatever its format: what is in it, and columns of numbers from it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol

from numpy.typing import NDArray

from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.lab.recordings.formats import array_tables, column_tables, dataflash, ros, tlog, ulog
from strapgen.lab.recordings.formats.csv_table import CsvTable
from strapgen.lab.recordings.log_topic import LogColumn, LogTopic
from strapgen.storage import streams

#: Bytes by which a format is recognized.
_HEAD = 512

__all__ = ["LogColumn", "LogFile", "LogTopic", "open_log"]


class LogFile(Protocol):
    """An opened file."""

    path: Path
    #: "csv", "ulog", "dataflash", "tlog", "ros1", "ros2", "mcap", "mat", "hdf5", "parquet" or "feather"
    format: str
    topics: tuple[LogTopic, ...]
    #: What is to be said of the file, a sentence each, as that it is truncated and what was whole
    remarks: tuple[str, ...]

    def read(self, topic: str, columns: Sequence[str]) -> dict[str, NDArray[Any]]:
        """Return columns of a topic, (rows,) each; integers stay integers, and long ones are on the disk.

        A cell without a number is nan.
        """

    def place(self, topic: str, row: int) -> str:
        """Return where a row stands that has been read, for an error: "line 17", "message 17", "row 17"."""


def open_log(path: str | Path) -> LogFile:
    """Open a file; its format follows from its first bytes and its suffix."""
    path = checks.path("path", path)
    if (path / "metadata.yaml").is_file():  # a bag of ROS 2 is a folder
        return ros.RosLog(path, "ros2")
    head = _head(path)
    if head.startswith(ulog.MAGIC):
        return ulog.ULog(path)
    if head.startswith(dataflash.MAGIC):
        return dataflash.DataFlash(path)
    if tlog.is_tlog(head):
        return tlog.TLog(path)
    for magic, kind in ros.MAGICS.items():
        if head.startswith(magic):
            return ros.RosLog(path, kind)
    for magic, kind in column_tables.MAGICS.items():
        if head.startswith(magic):
            return column_tables.ColumnLog(path, kind)
    if head.startswith((array_tables.HDF5, array_tables.MAT)):
        return array_tables.ArrayLog(path, head)
    return CsvTable(path)


def _head(path: Path) -> bytes:
    try:
        with streams.opened(path) as file:
            return file.read(_HEAD)
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror})") from None
