"""Drawing: polylines and surfaces out of the mixed leaves of a decoded state (spec clause 9).

Arrays in, arrays out; numpy is all it needs.
"""
