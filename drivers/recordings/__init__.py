"""Recordings in files: reading the formats of instruments and people, writing formats for other programs."""

from .formats.datatrace import read_data_trace
from .formats.netcdf_hdf5 import write_hdf5, write_netcdf
from .read import read_memory_trace, read_recording
from .text_file import RecordingError
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
