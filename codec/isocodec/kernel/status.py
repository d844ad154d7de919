"""Status of a kernel that codes: why it returned. Functions that it calls return it in place of a symbol."""

DONE = 0  # the pass is complete
NEED = -1  # the coder needs bytes (decoding) or room for them (encoding)
CUT = -2  # the stated number of symbols of a cut run has been coded
GROW = -3  # an array is nearly full
BAD = -4  # the stream violates the specification; the clause is in the state
