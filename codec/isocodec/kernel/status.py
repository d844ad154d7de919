"""Status of a kernel that codes: why it returned. Functions that it calls return it in place of a symbol."""

DONE = 0  # the pass is complete
NEED = -1  # the coder needs bytes (decoding) or room for them (encoding)
SPENT = -2  # what was granted has been used: symbols, or cells to be looked at
GROW = -3  # an array is nearly full
BAD = -4  # the stream violates the specification; the clause is in the state
