"""JBIG1 (ITU-T T.82) through the shared library of jbigkit 2: bi-level pictures to whole files and back."""

from __future__ import annotations

import ctypes
import ctypes.util
from functools import cache

import numpy as np
from numpy.typing import NDArray

SMID, ILEAVE, DPON, TPBON, TPDON = 0x01, 0x02, 0x04, 0x08, 0x10
"""Orders and options of jbig.h; these are the ones that its own command line sets."""
MOST_SHIFT = 8
"""Largest horizontal shift of the adaptive template, as that command line sets it."""
STATE_BYTES = 1 << 16
"""Room for its private structures, which take less than 10 kB."""
_SINK = ctypes.CFUNCTYPE(None, ctypes.POINTER(ctypes.c_ubyte), ctypes.c_size_t, ctypes.c_void_p)


@cache
def library() -> ctypes.CDLL | None:
    """The library, or None if it is not installed."""
    name = ctypes.util.find_library("jbig")
    for found in filter(None, (name, "libjbig.so.0", "libjbig.so.2.1")):
        try:
            lib = ctypes.CDLL(found)
            break
        except OSError:
            continue
    else:
        return None
    lib.jbg_enc_init.restype = None
    lib.jbg_dec_getimage.restype = ctypes.POINTER(ctypes.c_ubyte)
    for name in ("jbg_dec_getwidth", "jbg_dec_getheight"):
        getattr(lib, name).restype = ctypes.c_ulong
    return lib


def encode(mask: NDArray[np.bool_], layers: int = 0) -> bytes:
    """Encode a picture (rows, columns) of bool in one stripe, ``layers`` resolutions on top of the lowest."""
    lib = library()
    assert lib is not None
    rows, columns = mask.shape
    packed = np.packbits(mask, axis=1)
    out = bytearray()
    sink = _SINK(lambda start, count, _: out.extend(ctypes.string_at(start, count)))
    state = ctypes.create_string_buffer(STATE_BYTES)
    planes = (ctypes.c_void_p * 1)(packed.ctypes.data)
    lib.jbg_enc_init(state, ctypes.c_ulong(columns), ctypes.c_ulong(rows), 1, planes, sink, None)
    # first the layers, which set the lines a stripe too
    lib.jbg_enc_layers(state, layers)
    lib.jbg_enc_options(state, SMID | ILEAVE, TPDON | TPBON | DPON, ctypes.c_ulong(rows), MOST_SHIFT, 0)
    lib.jbg_enc_out(state)
    lib.jbg_enc_free(state)
    return bytes(out)


def decode(data: bytes) -> NDArray[np.bool_]:
    """The picture (rows, columns) of a file."""
    lib = library()
    assert lib is not None
    state = ctypes.create_string_buffer(STATE_BYTES)
    lib.jbg_dec_init(state)
    try:
        at, taken, status = 0, ctypes.c_size_t(), 0x10
        while at < len(data):
            # it returns early where a resolution is complete
            status = lib.jbg_dec_in(state, data[at:], ctypes.c_size_t(len(data) - at), ctypes.byref(taken))
            at += taken.value
            if status not in (0x10, 0x20) or not taken.value:
                break
        if status not in (0x00, 0x10):
            raise ValueError(f"jbigkit answers {status:#x}")
        rows, columns = lib.jbg_dec_getheight(state), lib.jbg_dec_getwidth(state)
        width = (columns + 7) // 8
        packed = np.ctypeslib.as_array(lib.jbg_dec_getimage(state, 0), (rows, width)).copy()
    finally:
        lib.jbg_dec_free(state)
    return np.unpackbits(packed, axis=1)[:, :columns].astype(bool)
