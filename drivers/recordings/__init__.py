"""Recordings in files: read what instruments and people write, write what others read."""

from .archive import write_hdf5, write_netcdf
from .datatrace import read_data_trace
from .page import RecordingError
from .read import read_memory_trace, read_recording
from .write import csv_text, write_csv, write_touchstone

__all__ = [
    "RecordingError",
    "csv_text",
    "read_data_trace",
    "read_memory_trace",
    "read_recording",
    "write_csv",
    "write_hdf5",
    "write_netcdf",
    "write_touchstone",
]
