# SPDX-License-Identifier: MIT
"""WAV and FLAC of recorders, through soundfile."""

from __future__ import annotations

from pathlib import Path

from okid.data.memory import require_samples
from okid.data.records import Record
from okid.formats.foreign_library import library, reading


def read_sound(path: str | Path) -> Record:
    """Read a WAV or FLAC file: channels ch1, ch2 .. as parts of full scale (1 = full scale), exact for up to 32 bits.

    What full scale is in units of the sensor stands in no such file. InputError when soundfile is missing or the file
    is damaged.
    """
    soundfile = library("soundfile", "WAV and FLAC")
    with reading(path, "a WAV or FLAC file"):
        with soundfile.SoundFile(str(path)) as file:
            require_samples(file.frames, file.channels)
            samples, rate, title = file.read(dtype="float64", always_2d=True), float(file.samplerate), file.title
        names = [f"ch{number}" for number in range(1, samples.shape[1] + 1)]
        remark = "values are parts of full scale: multiply them by the recorder's full scale for units"
        return Record(names, samples, rate, title=str(title or ""), remarks=[remark])
